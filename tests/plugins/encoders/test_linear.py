"""`linear` (3PU's first layer): one linear layer on each point's coordinates, without activation."""

import torch

from pcsr import Trait, Widths
from pcsr_plugins.encoders.linear import Linear
from tests.plugins.compare import close


@torch.no_grad()
def test_linear_is_a_matrix_and_an_offset_point_by_point():
    encoder, points = Linear(Widths(), channels=5), torch.randn(2, 9, 3)
    features = encoder(points)
    assert features.shape == (2, 9, encoder.channels)
    assert features.min() < 0, "there is no activation"
    for b in range(2):
        for i in range(9):
            close(features[b, i], encoder.layer.weight @ points[b, i] + encoder.layer.bias, 1e-6)


def test_its_width_by_default_is_that_of_the_papers():
    assert Linear(Widths())(torch.randn(1, 2, 3)).shape == (1, 2, 24)
    assert Linear.traits == {Trait.PERMUTATION_EQUIVARIANT}
