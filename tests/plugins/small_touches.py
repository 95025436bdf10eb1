"""Touches for fusions of a few channels."""

import torch

from pcsr import Touches, Widths

WIDTHS = Widths(visual=8, touch=4, refined=12, rate=3)


def touched(mask: list[list[bool]], points: int = 10) -> Touches:
    shape = (len(mask), len(mask[0]), points)
    return Touches(torch.randn(*shape, 3), torch.randn(*shape, WIDTHS.touch), torch.tensor(mask))
