"""`shuffle`: each point's channels cut into coordinates (TAPSR, Sec. 3.4)."""

import pytest
import torch

from pcsr import UserError, Widths
from pcsr_plugins.upsamplers.shuffle import Shuffle, neighbour_offsets
from tests.plugins.compare import check_single_precision, close, like
from tests.plugins.small_touches import WIDTHS


def test_the_upsampler_has_its_gradients_in_single_precision():
    widths, points, features = Widths(refined=64, rate=16), torch.randn(2, 60, 3), torch.randn(2, 60, 64)
    shuffle = Shuffle(widths, start="neighbours")
    torch.nn.init.normal_(shuffle.mlp[2].weight)
    check_single_precision(
        shuffle, lambda part: part(like(part, points), like(part, features), 16), torch.randn(2, 960, 3)
    )


def test_shuffle_cuts_each_point_into_pieces_of_its_channels():
    shuffle, points, features = Shuffle(WIDTHS, hidden=6), torch.randn(2, 5, 3), torch.randn(2, 5, 12)
    dense = shuffle(points, features, 3)
    assert dense.shape == (2, 15, 3)
    for i in range(5):
        for r in range(3):
            close(dense[:, 3 * i + r], shuffle.mlp(features[:, i, 4 * r : 4 * r + 4]), 1e-6)


def test_shuffle_can_start_on_the_ways_to_the_neighbours():
    widths, points, features = Widths(refined=32, rate=16), torch.randn(2, 30, 3), torch.randn(2, 30, 32)
    shuffle = Shuffle(widths, start="neighbours")
    candidates, spacing = neighbour_offsets(points, 16)
    close(shuffle(points, features, 16), candidates, 1e-6)  # untrained it is the fan itself
    with torch.no_grad():
        shuffle.mlp[2].bias.fill_(0.5)
    moved = (shuffle(points, features, 16) - candidates).view(2, 30, 16, 3)
    close(moved, 0.5 * spacing.unsqueeze(-1).expand(2, 30, 16, 3), 1e-5)


@pytest.mark.parametrize("rate", [1, 4, 8, 12, 16])
def test_a_fan_reaches_out_to_the_nearest_neighbours(rate):
    points = torch.randn(1, 40, 3).double()
    candidates, spacing = neighbour_offsets(points, rate)
    candidates = candidates.view(40, rate, 3)
    spokes, rings = min(8, rate), -(-rate // min(8, rate))
    for i in range(40):
        distance = (points[0] - points[0, i]).norm(dim=-1)
        nearest = distance.argsort()[1 : spokes + 1]
        close(spacing[0, i, 0], distance[nearest].mean(), 1e-9)
        for j in range(rate):
            share = 0.4 * (1 - (j // spokes) / rings)
            close(candidates[i, j], points[0, i] + share * (points[0, nearest[j % spokes]] - points[0, i]), 1e-7)
    assert len(candidates.flatten(0, 1).unique(dim=0)) == 40 * rate


def test_the_fan_of_a_larger_cloud_is_larger():
    points, features = torch.randn(1, 30, 3), torch.randn(1, 30, 32)
    shuffle = Shuffle(Widths(refined=32, rate=16), start="neighbours")
    torch.nn.init.normal_(shuffle.mlp[2].weight)
    close(shuffle(5 * points, features, 16), 5 * shuffle(points, features, 16), 1e-4)


def test_shuffle_refuses_another_rate():
    with pytest.raises(UserError, match="built for rate 3, not 4"):
        Shuffle(WIDTHS)(torch.randn(1, 5, 3), torch.randn(1, 5, 12), 4)


def test_shuffle_refuses_channels_that_the_rate_does_not_divide():
    with pytest.raises(UserError, match="12 channels into 5 equal pieces, which leaves 2 over"):
        Shuffle(Widths(refined=12, rate=5))
