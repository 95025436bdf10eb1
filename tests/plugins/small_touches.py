"""Touches for fusions of a few channels."""

import torch

from pcsr import TouchBatch, Widths

WIDTHS = Widths(visual=8, touch=4, refined=12, rate=3)


def touched(mask: list[list[bool]], points: int = 10) -> TouchBatch:
    shape = (len(mask), len(mask[0]), points)
    return TouchBatch(torch.randn(*shape, 3), torch.randn(*shape, WIDTHS.touch), torch.tensor(mask))
