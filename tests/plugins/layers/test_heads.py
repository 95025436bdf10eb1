"""Zero-initialised heads."""

import torch
from torch import nn

from pcsr_plugins.layers.heads import displacement_head, zero_linear


def test_an_untrained_head_moves_nothing_and_can_learn():
    for head in (zero_linear(6, 3), displacement_head(6, 3)):
        moves = head(torch.randn(2, 5, 6))
        assert torch.equal(moves, torch.zeros(2, 5, 3))
        (moves - 1).square().sum().backward()
        last = head if isinstance(head, nn.Linear) else head[-1]
        assert last.weight.grad.abs().sum() > 0


def test_a_displacement_head_is_two_layers_after_relu():
    head, x = displacement_head(6, 3), torch.randn(5, 6)
    nn.init.normal_(head[-1].weight)
    torch.testing.assert_close(head(x), head[3](head[1](x.relu()).relu()))
