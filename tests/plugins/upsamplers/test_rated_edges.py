"""`rated-edges`: the candidates of `edge-offsets`, displaced copies of the points, and predicted errors."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from pcsr import Widths
from pcsr_plugins.layers.local_frames import LocalFrames
from pcsr_plugins.upsamplers.edge_offsets import EdgeOffsets
from pcsr_plugins.upsamplers.rated_edges import RatedEdges
from tests.plugins.slow_frames import curved, rotation

CHANNELS = 5
WIDTHS = Widths(refined=CHANNELS, rate=4)


def features(points, seed=0):
    random = torch.Generator().manual_seed(seed)
    return torch.randn(*points.shape[:2], CHANNELS, generator=random, dtype=points.dtype)


def trained(seed=0, std=0.3):
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        upsampler = RatedEdges(WIDTHS, hidden=8).double()
        for layer in (upsampler.mlp[-1], upsampler.error, upsampler.own[-1][-1]):
            nn.init.normal_(layer.weight, std=std)
    return upsampler


@pytest.mark.parametrize("rate", [1, 4, 8])
@torch.no_grad()
def test_untrained_it_is_edge_offsets_with_equal_errors_in_local_spacings(rate):
    points = curved()
    known = features(points)
    upsampler = RatedEdges(WIDTHS, hidden=8).double()
    plain = EdgeOffsets(WIDTHS, hidden=8).double()
    plain.load_state_dict({n: t for n, t in upsampler.state_dict().items() if n in plain.state_dict()})
    dense, errors = upsampler.with_errors(points, known, rate)
    assert torch.equal(dense, plain(points, known, rate))
    spacing = LocalFrames.of(points, 16).unit
    torch.testing.assert_close(errors.unflatten(1, (60, -1)) / spacing, torch.full((2, 60, 1), 0.0486).double().expand(
        -1, -1, errors.shape[1] // 60
    ), atol=1e-4, rtol=0)  # fmt: skip


@torch.no_grad()
def test_the_first_of_each_points_candidates_is_a_copy_displaced_along_its_normal():
    points = curved()
    known = features(points)
    upsampler = trained()
    copies = upsampler(points, known, 4).unflatten(1, (60, -1))[:, :, 0]
    frames = LocalFrames.of(points, 16)
    height = upsampler.own(known)[..., :1]
    torch.testing.assert_close(copies, points + frames.unit * frames.rough * height * frames.normal)
    assert (copies - points).norm(dim=-1).min() > 0


@given(seed=st.integers(0, 1000), scale=st.floats(0.1, 10))
@settings(max_examples=10)
@torch.no_grad()
def test_points_and_errors_move_turn_and_scale_with_the_cloud(seed, scale):
    points = curved(seed)
    known, turn, shift = features(points), rotation(seed, torch.float64), torch.tensor([0.3, -0.2, 0.1]).double()
    upsampler = trained(seed)
    dense, errors = upsampler.with_errors(points, known, 4)
    moved, moved_errors = upsampler.with_errors(scale * points @ turn + shift, known, 4)
    torch.testing.assert_close(moved, scale * dense @ turn + shift, atol=1e-8, rtol=0)
    torch.testing.assert_close(moved_errors, scale * errors, atol=1e-8, rtol=1e-6)
    assert torch.equal(upsampler(points, known, 4), dense)


@torch.no_grad()
def test_errors_are_positive_whatever_is_learned():
    points = curved()
    _, errors = trained(std=30.0).with_errors(points, features(points), 4)
    assert errors.min() >= 0
    assert errors.max() > 1
