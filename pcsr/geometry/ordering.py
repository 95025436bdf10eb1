"""A space-filling curve through a cloud: neighbours on the curve are neighbours in space.

Layers that pool or convolve along the point axis need an order. A cloud has none, so it is given this one: then
windows along the axis are neighbourhoods, and the result no longer depends on the order in the file.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

BITS = 10
"""Bits for each coordinate: 1024 cells along each side, far finer than the spacing of any cloud a network sees."""


def hilbert_order(points: Float[Tensor, "*b n 3"]) -> Int[Tensor, "*b n"]:
    """The permutation that sorts points along a Hilbert curve through their bounding cube.

    Skilling's transposition (AIP Conf. Proc. 707, 2004) on whole tensors. Unlike a Morton curve it never
    jumps: consecutive cells share a face. Points of one cell are sorted by their coordinates, so that the
    order is a function of the points alone.
    """
    with torch.no_grad():
        low = points.amin(-2, keepdim=True)
        side = (points - low).amax((-1, -2), keepdim=True).clamp_min(torch.finfo(points.dtype).tiny)
        x, y, z = ((points - low) / side * 2**BITS).long().clamp(0, 2**BITS - 1).unbind(-1)
        code = _hilbert_code([x, y, z])
        # Sort by the last key first: each sort is stable, so the code decides and coordinates break its ties.
        order = torch.argsort(points[..., 2], dim=-1, stable=True)
        for key in (points[..., 1], points[..., 0], code):
            order = order.gather(-1, torch.argsort(key.gather(-1, order), dim=-1, stable=True))
        return order


def _hilbert_code(axes: list[Tensor]) -> Tensor:
    """Cell coordinates to the position on the curve."""
    x = list(axes)
    bit = 1 << (BITS - 1)
    while bit > 1:  # undo the rotations that the curve makes on its way down
        low = bit - 1
        for i in range(3):
            set_here = (x[i] & bit) != 0
            swap = torch.where(set_here, 0, (x[0] ^ x[i]) & low)
            x[i] = x[i] ^ swap
            x[0] = torch.where(set_here, x[0] ^ low, x[0] ^ swap)
        bit >>= 1
    x[1] = x[1] ^ x[0]  # Gray code
    x[2] = x[2] ^ x[1]
    turn = torch.zeros_like(x[0])
    bit = 1 << (BITS - 1)
    while bit > 1:
        turn = torch.where((x[2] & bit) != 0, turn ^ (bit - 1), turn)
        bit >>= 1
    x = [axis ^ turn for axis in x]
    code = torch.zeros_like(x[0])
    for b in range(BITS - 1, -1, -1):
        for axis in x:
            code = (code << 1) | ((axis >> b) & 1)
    return code


def along(order: Int[Tensor, "b n"], features: Float[Tensor, "b n c"]) -> Float[Tensor, "b n c"]:
    """Put rows into an order."""
    return features.gather(1, order.unsqueeze(-1).expand_as(features))


def back(order: Int[Tensor, "b n"], features: Float[Tensor, "b n c"]) -> Float[Tensor, "b n c"]:
    """Undo `along`."""
    return torch.zeros_like(features).scatter(1, order.unsqueeze(-1).expand_as(features), features)
