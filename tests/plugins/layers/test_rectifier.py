"""Rectifiers: ReLU, or a leaky one."""

import torch
from torch.nn import functional as F

from pcsr_plugins.layers.rectifier import rectifier


def test_a_slope_of_zero_is_relu_bit_for_bit():
    x = torch.randn(1000)
    assert torch.equal(rectifier(0.0)(x), F.relu(x))


def test_below_zero_it_has_the_slope_as_its_gradient():
    x = torch.tensor([-2.0, 3.0], requires_grad=True)
    y = rectifier(0.25)(x)
    y.sum().backward()
    assert y.tolist() == [-0.5, 3.0]
    assert x.grad.tolist() == [0.25, 1.0]
