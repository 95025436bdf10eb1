"""Order of points along a Hilbert curve, a space-filling curve: neighbours on the curve are neighbours in space.

Layers that pool or convolve along the point axis need an order, which a cloud does not have. In this one, windows along
the axis are neighbourhoods, and the result does not depend on the order of the input.
"""

import torch
from jaxtyping import Float, Int
from torch import Tensor

BITS = 10
"""Bits for each coordinate: 1024 cells along each side, far finer than the point spacing of a network's input."""


def hilbert_order(points: Float[Tensor, "*b n 3"]) -> Int[Tensor, "*b n"]:
    """Return the permutation that sorts points along a Hilbert curve through their bounding cube.

    The positions on the curve follow Skilling (AIP Conf. Proc. 707, 2004). Consecutive cells share a face, unlike those
    of a Morton curve. Points of the same cell are sorted by their coordinates, so that the result does not depend on
    the order of the input.

    Examples:
        >>> corners = torch.tensor([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        >>> hilbert_order(corners)
        tensor([0, 3, 1, 2])
    """
    with torch.no_grad():
        low = points.amin(-2, keepdim=True)
        side = (points - low).amax((-1, -2), keepdim=True).clamp_min(torch.finfo(points.dtype).tiny)
        code = _hilbert_code(((points - low) / side * 2**BITS).long().clamp(0, 2**BITS - 1))
        # Stable sorts with the last key first: the position on the curve decides, and coordinates resolve ties.
        order = torch.argsort(points[..., 2], dim=-1, stable=True)
        for key in (points[..., 1], points[..., 0], code):
            order = order.gather(-1, torch.argsort(key.gather(-1, order), dim=-1, stable=True))
        return order


def _hilbert_code(cells: Int[Tensor, "*b n 3"]) -> Int[Tensor, "*b n"]:
    """Convert cell coordinates to positions on the curve, octant by octant from the coarsest to the finest."""
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
    """Return the curve as the transition table of a finite-state machine.

    The machine reads a cell's octants from the coarsest to the finest. Entry 8·state + octant holds 8·(next state) plus
    the next digit of the position, to base 8. A state is the effect of the previous steps of Skilling's loop on all
    finer bits: the permutation of the axes, which of them are inverted, and whether the digit is.
    """
    states = [((0, 1, 2), (0, 0, 0), 0)]
    table = []
    for axes, inverted, turn in states:  # the loop appends to `states`
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
"""Transition table of the Hilbert curve."""


def along(order: Int[Tensor, "b n"], features: Float[Tensor, "b n c"]) -> Float[Tensor, "b n c"]:
    """Permute the rows of features into the given order."""
    return features.gather(1, order.unsqueeze(-1).expand_as(features))


def back(order: Int[Tensor, "b n"], features: Float[Tensor, "b n c"]) -> Float[Tensor, "b n c"]:
    """Permute the rows of features back: the inverse of `along`."""
    return torch.zeros_like(features).scatter(1, order.unsqueeze(-1).expand_as(features), features)
