"""Batch norms over points, and linear layers that take them in."""

import pytest
import torch
from torch import nn

from pcsr_plugins.layers.linear_norm_relu import LinearNormReLU, PointNorm
from tests.plugins.compare import close
from tests.plugins.published import lively


@pytest.mark.parametrize("shape", [(3, 7), (2, 5, 7), (2, 5, 4, 7)])
@pytest.mark.parametrize("training", [False, True])
def test_the_norm_is_a_batch_norm_over_all_but_the_channels(shape, training):
    ours, plain = (lively(kind(7)).train(training) for kind in (PointNorm, nn.BatchNorm1d))
    plain.load_state_dict(ours.state_dict())
    x = torch.randn(shape)
    close(ours(x).reshape(-1, 7), plain(x.reshape(-1, 7)))
    close(ours.running_var, plain.running_var)


@pytest.mark.parametrize("shape", [(3, 7), (2, 5, 4, 7)])
@pytest.mark.parametrize("training", [False, True])
def test_the_norm_is_part_of_the_linear_layer_where_it_may_be(shape, training):
    layer, x = lively(LinearNormReLU(7, 5)).train(training), torch.randn(shape)
    linear, norm, found = layer.linear, layer.norm, layer(x)
    expected = nn.functional.batch_norm(
        linear(x).reshape(-1, 5),
        None if training else norm.running_mean,
        None if training else norm.running_var,
        *(norm.weight, norm.bias),
        training=training,
    )
    close(found, expected.relu().view(found.shape))
