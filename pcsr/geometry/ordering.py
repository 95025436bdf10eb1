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
        code = _hilbert_code(((points - low) / side * 2**BITS).long().clamp(0, 2**BITS - 1))
        # Sort by the last key first: each sort is stable, so the code decides and coordinates break its ties.
        order = torch.argsort(points[..., 2], dim=-1, stable=True)
        for key in (points[..., 1], points[..., 0], code):
            order = order.gather(-1, torch.argsort(key.gather(-1, order), dim=-1, stable=True))
        return order


def _hilbert_code(cells: Int[Tensor, "*b n 3"]) -> Int[Tensor, "*b n"]:
    """Cell coordinates to the position on the curve, octant by octant from the coarsest to the finest."""
    bits = torch.arange(BITS - 1, -1, -1, device=cells.device).view(-1, *[1] * cells.dim())
    x, y, z = (cells.bitwise_right_shift(bits) & 1).unbind(-1)  # (BITS *b n)
    table = torch.tensor(CURVE, device=cells.device)
    code = state = torch.zeros_like(cells[..., 0])
    for octant in 4 * x + 2 * y + z:
        entry = table[state + octant]
        digit = entry & 7
        code, state = 8 * code + digit, entry - digit
    return code


def _curve() -> list[int]:
    """The curve as a machine that reads a cell's octants from the coarsest to the finest.

    Entry 8·state + octant holds 8·(next state) + the digit of the code. A state is what Skilling's loop over the
    bits has done so far to all finer ones: which axis each comes from, whether it is inverted, and whether the digit
    will be.
    """
    states = [((0, 1, 2), (0, 0, 0), 0)]
    table = []
    for axes, inverted, turn in states:  # grows as it is walked
        for octant in range(8):
            raw = (octant >> 2, octant >> 1 & 1, octant & 1)
            bits = [raw[axis] ^ flip for axis, flip in zip(axes, inverted, strict=True)]
            a, f = list(axes), list(inverted)
            for i, bit in enumerate(bits):
                if bit:
                    f[0] ^= 1
                else:
                    a[0], a[i], f[0], f[i] = a[i], a[0], f[i], f[0]
            gray = bits[0], bits[0] ^ bits[1], bits[0] ^ bits[1] ^ bits[2]
            digit = sum((bit ^ turn) << (2 - i) for i, bit in enumerate(gray))
            following = ((a[0], a[1], a[2]), (f[0], f[1], f[2]), turn ^ gray[2])
            if following not in states:
                states.append(following)
            table.append(8 * states.index(following) + digit)
    return table


CURVE = _curve()


def along(order: Int[Tensor, "b n"], features: Float[Tensor, "b n c"]) -> Float[Tensor, "b n c"]:
    """Put rows into an order."""
    return features.gather(1, order.unsqueeze(-1).expand_as(features))


def back(order: Int[Tensor, "b n"], features: Float[Tensor, "b n c"]) -> Float[Tensor, "b n c"]:
    """Undo `along`."""
    return torch.zeros_like(features).scatter(1, order.unsqueeze(-1).expand_as(features), features)
