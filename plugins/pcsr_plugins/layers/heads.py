"""MLP heads that predict displacements, zero-initialised: an untrained head moves nothing."""

from torch import nn


def zero_linear(c_in: int, c_out: int) -> nn.Linear:
    """A linear layer whose weights and bias are 0."""
    layer = nn.Linear(c_in, c_out)
    nn.init.zeros_(layer.weight)
    nn.init.zeros_(layer.bias)
    return layer


def displacement_head(hidden: int, c_out: int) -> nn.Sequential:
    """ReLU, linear, ReLU and a zero-initialised linear layer, after a first layer of `hidden` channels."""
    last = zero_linear(hidden, c_out)
    return nn.Sequential(nn.ReLU(), nn.Linear(hidden, hidden), nn.ReLU(), last)
