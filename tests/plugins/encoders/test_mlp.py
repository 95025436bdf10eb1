"""`mlp`: one layer on each point's coordinates."""

import torch

from pcsr import Widths
from pcsr_plugins.encoders.mlp import Mlp
from tests.plugins.compare import close


def test_mlp_sees_each_point_alone():
    mlp, points = Mlp(Widths(), channels=5), torch.randn(2, 9, 3)
    close(mlp(points)[:, 4:5], mlp(points[:, 4:5]), 1e-6)


def test_without_a_norm_the_encoder_keeps_its_weights_names():
    assert list(Mlp(Widths()).state_dict()) == ["layer.0.weight", "layer.0.bias"]
