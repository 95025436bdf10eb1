"""Rectifiers: ReLU, or a leaky one, of which no channel is 0, and without a gradient, at every point."""

from typing import Annotated

from pydantic import Field
from torch import nn

NegativeSlope = Annotated[float, Field(ge=0, lt=1)]
"""Slope of a rectifier below zero; 0 is ReLU."""


def rectifier(negative_slope: float) -> nn.Module:
    """Return a layer max(x, slope·x), a ReLU if the slope is 0."""
    return nn.LeakyReLU(negative_slope) if negative_slope else nn.ReLU()
