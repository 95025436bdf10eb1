"""`edge-offsets`: candidates on the edges to points around each, enough at any rate; learned heights and scales."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from pcsr import Trait, UserError, Widths
from pcsr_plugins.layers.edge_candidates import FARTHEST
from pcsr_plugins.layers.local_frames import LocalFrames
from pcsr_plugins.upsamplers.edge_offsets import EdgeOffsets
from tests.plugins.slow_frames import grid, rotation, slow_around, slow_edge, slow_frame

CHANNELS = 5
WIDTHS = Widths(refined=CHANNELS, rate=4)


def cloud(seed=0, n=30, rows=2):
    """In double precision: where a way lies between two angles, rounding would decide who has it."""
    random = torch.Generator().manual_seed(seed)
    shape, options = (rows, n), {"generator": random, "dtype": torch.float64}
    return torch.randn(*shape, 3, **options), torch.randn(*shape, CHANNELS, **options)


def untrained(**options):
    return EdgeOffsets(WIDTHS, **options).double()


def trained(seed=0, std=0.1, **options):
    """One that moves its positions."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        fan = untrained(hidden=8, **options)
        nn.init.normal_(fan.mlp[-1].weight, std=std)
    return fan


def slowly(fan, points, features, rate):
    """Place by place, for one row."""
    frames = [slow_frame(points, i, fan.neighbours) for i in range(len(points))]
    rings = next(rings for rings in range(1, 100) if rings * fan.spokes >= fan.surplus * rate)
    made = []
    for i, (near, offsets, unit, normal, rough) in enumerate(frames):
        made.append(points[i])
        around = slow_around(offsets, normal, fan.spokes)
        for ring in range(1, rings + 1):
            share = FARTHEST * ring / rings
            for j, way in zip(near[around], offsets[around], strict=True):
                edge = slow_edge(frames[i], frames[j], way)
                known = fan.here(features[i]) + fan.there(features[j]) + fan.edge(edge)
                height, reach = rough * fan.mlp(known + fan.share(torch.tensor([share, share**2], dtype=points.dtype)))
                up = nn.functional.normalize((1 - share) * normal + share * frames[j][3], dim=0)
                made.append(points[i] + unit * (2 * share / (1 + torch.exp(-reach)) * way + height * up))
    return torch.stack(made)


@given(seed=st.integers(0, 1000), n=st.integers(2, 40), rate=st.integers(1, 20))
@settings(max_examples=40)
@torch.no_grad()
def test_untrained_places_are_on_the_near_half_of_the_ways_to_neighbours(seed, n, rate):
    points, features = cloud(seed, n, rows=1)
    dense = untrained()(points, features, rate).view(n, -1, 3)
    points, spokes = points[0], min(8, n - 1)
    assert torch.equal(dense[:, 0], points), "the points themselves are positions too"
    near = torch.cdist(points, points).argsort(1)[:, 1:17]
    offsets, positions = (points[near] - points[:, None])[:, None], (dense - points[:, None])[:, 1:, None]
    share = (positions * offsets).sum(-1) / offsets.square().sum(-1)  # (point position neighbour)
    off, which = (positions - share.unsqueeze(-1) * offsets).norm(dim=-1).min(-1)
    assert off.max() < 1e-9
    share = share.gather(-1, which.unsqueeze(-1)).view(n, -1, spokes)  # ring by ring
    steps = torch.arange(1, share.shape[1] + 1, dtype=share.dtype) / share.shape[1]
    torch.testing.assert_close(share, (FARTHEST * steps).view(1, -1, 1).expand_as(share), atol=1e-9, rtol=0)
    assert share.max() <= 0.45 + 1e-9, "beyond half of the way lie the neighbour's own positions"


@given(seed=st.integers(0, 1000), n=st.integers(2, 30), rate=st.integers(1, 12), dimensions=st.sampled_from([1, 2, 3]))
@settings(max_examples=30)
@torch.no_grad()
def test_there_are_as_many_different_places_as_wanted_though_nobody_lies_at_some_angles(seed, n, rate, dimensions):
    points, features = cloud(seed, n, rows=1)
    points[..., dimensions:] = 0
    for positions in untrained()(points, features, rate).view(n, -1, 3):
        assert len(positions.unique(dim=0)) >= 1 + rate


@given(
    n=st.integers(2, 30),
    rate=st.integers(1, 40),
    spokes=st.integers(1, 12),
    surplus=st.sampled_from([1.0, 1.5, 2.0, 3.25]),
)
@torch.no_grad()
def test_at_any_rate_there_are_at_least_as_many_as_wanted_and_not_many_more(n, rate, spokes, surplus):
    points, features = cloud(n=n)
    fan = untrained(hidden=4, spokes=spokes, surplus=surplus)
    dense = fan(points, features, rate)
    assert dense.shape[0] == 2
    assert dense.shape[1] >= (1 + surplus * rate) * n
    assert dense.shape[1] < (1 + surplus * rate + spokes) * n
    assert Trait.ANY_RATE in EdgeOffsets.traits


@given(seed=st.integers(0, 1000), scale=st.floats(0.1, 10), rate=st.integers(1, 9))
@settings(max_examples=30)
@torch.no_grad()
def test_untrained_places_move_turn_and_scale_with_the_cloud(seed, scale, rate):
    points, features = cloud(seed)
    turn, shift = rotation(seed, torch.float64), torch.tensor([0.3, -0.2, 0.1], dtype=torch.float64)
    fan = untrained()
    moved = fan(scale * points @ turn + shift, features, rate)
    torch.testing.assert_close(moved, scale * fan(points, features, rate) @ turn + shift, atol=1e-9, rtol=0)


@given(seed=st.integers(0, 1000), scale=st.floats(0.1, 10), rate=st.integers(1, 9))
@settings(max_examples=20)
@torch.no_grad()
def test_what_is_learned_moves_turns_and_scales_with_the_cloud(seed, scale, rate):
    points, features = cloud(seed, 60)
    points = nn.functional.normalize(points, dim=2)  # curved, so that it is certain which side is up
    turn, shift = rotation(seed, torch.float64), torch.tensor([0.3, -0.2, 0.1], dtype=torch.float64)
    fan = trained(seed)
    dense = fan(points, features, rate)
    assert (dense - untrained()(points, features, rate)).abs().max() > 1e-3, "it has learned nothing"
    moved = fan(scale * points @ turn + shift, features, rate)
    torch.testing.assert_close(moved, scale * dense @ turn + shift, atol=1e-9, rtol=0)


@torch.no_grad()
def test_what_is_flat_stays_flat():
    points, features = cloud(n=40)
    points[..., 2] = 0
    assert torch.equal(trained(std=100.0)(points, features, 4), untrained()(points, features, 4))


@torch.no_grad()
def test_where_the_neighbourhood_is_flat_nothing_moves_whatever_is_rough_elsewhere():
    points = grid()
    left = points[0, :, 0]
    points[..., 2] = torch.where(left > 0, 0.02 * torch.randn(len(left), dtype=torch.float64), 0)
    flat = left < -0.3
    fan = EdgeOffsets(Widths(refined=5), neighbours=8).double()
    features = torch.randn(1, points.shape[1], 5, dtype=torch.float64)
    still = fan(points, features, 4)
    nn.init.normal_(fan.mlp[-1].weight, std=100.0)
    moved = (fan(points, features, 4) - still).norm(dim=2).view(points.shape[1], -1).amax(1)
    assert moved[flat].max() < 1e-9
    assert moved[left > 0].min() > 1e-3


@given(seed=st.integers(0, 1000), rate=st.integers(1, 9))
@settings(max_examples=20)
@torch.no_grad()
def test_what_is_learned_moves_places_along_way_and_normal_and_the_points_not_at_all(seed, rate):
    points, features = cloud(seed)
    fan = trained(seed)
    moved = (fan(points, features, rate) - untrained()(points, features, rate)).view(2, 30, -1, 3)
    assert moved[:, :, 0].abs().max() == 0
    assert moved.norm(dim=-1).max() > 1e-3
    frames = LocalFrames.of(points, fan.neighbours)
    j = frames.index.gather(2, frames.around(fan.spokes))  # (2 30 spokes)
    ends = torch.stack([normal[columns] for normal, columns in zip(frames.normal, j, strict=True)])
    share = FARTHEST * torch.arange(1, 1 + moved.shape[2] // j.shape[2], dtype=points.dtype).view(-1, 1, 1)
    share = share * j.shape[2] / (moved.shape[2] - 1)
    normal = (1 - share) * frames.normal[:, :, None, None] + share * ends.unsqueeze(2)  # (2 30 rings spokes 3)
    way = torch.stack([offsets[columns] for offsets, columns in zip(points, j, strict=True)]) - points.unsqueeze(2)
    across = torch.linalg.cross(normal, way.unsqueeze(2).expand_as(normal))
    assert (moved[:, :, 1:] * across.flatten(2, 3)).sum(-1).abs().max() < 1e-9


@pytest.mark.parametrize(("learned", "share"), [(-1e3, 0.0), (0.0, 1.0), (1e3, 2.0)])
@torch.no_grad()
def test_a_place_goes_none_to_twice_of_its_share_of_the_way(learned, share):
    points, features = cloud()
    fan, plain = untrained(), untrained()(points, features, 4)
    fan.mlp[-1].bias[1] = learned
    origin = points.unsqueeze(2)
    expected = origin + share * (plain.view(2, 30, -1, 3) - origin)
    torch.testing.assert_close(fan(points, features, 4), expected.flatten(1, 2), atol=1e-9, rtol=0)


@pytest.mark.parametrize("rate", [1, 4, 7])
@torch.no_grad()
def test_it_equals_itself_place_by_place(rate):
    points, features = cloud(n=24)
    fan = trained()
    for b in range(2):
        torch.testing.assert_close(
            fan(points, features, rate)[b], slowly(fan, points[b], features[b], rate), atol=1e-9, rtol=0
        )


def test_gradients_reach_the_features_and_every_weight_but_at_first_only_the_last_layer():
    points, features = cloud()
    features.requires_grad_()
    fan = trained()
    fan(points, features, 4).square().sum().backward()
    assert (features.grad != 0).any(2).all()
    assert all(weight.grad.abs().max() > 0 for weight in fan.parameters())
    new = untrained()
    new(points, features, 4).square().sum().backward()
    assert new.mlp[-1].weight.grad.abs().max() > 0


@torch.no_grad()
def test_points_that_coincide_stay_finite():
    points, features = torch.zeros(1, 20, 3), torch.zeros(1, 20, CHANNELS)
    assert trained().float()(points, features, 4).isfinite().all()


def test_a_single_point_has_no_neighbours():
    points, features = cloud(n=1)
    with pytest.raises(UserError, match="2 neighbours were asked of 1 points"):
        untrained()(points, features, 4)
