"""`fan`: before training its places are on the ways between neighbours, and it has enough of them at any rate."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

from pcsr import Trait, UserError, Widths
from pcsr_plugins.upsamplers.fan import FARTHEST, Fan

CHANNELS = 5
WIDTHS = Widths(refined=CHANNELS, rate=4)


def cloud(seed=0, n=30, rows=2):
    random = torch.Generator().manual_seed(seed)
    return torch.randn(rows, n, 3, generator=random), torch.randn(rows, n, CHANNELS, generator=random)


def trained(seed=0, **options):
    """One that moves its places."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        fan = Fan(WIDTHS, hidden=8, **options)
        nn.init.normal_(fan.mlp[-1].weight, std=0.1)
    return fan


def rotation(seed):
    q, r = torch.linalg.qr(torch.randn(3, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64))
    q = q * r.diagonal().sign()
    return (q * torch.tensor([q.det().sign(), 1, 1])).float()


def slow_frame(points, i, neighbours):
    """Of one point: its neighbours, the ways to them in units of the spacing, that, the normal and how rough it is."""
    near = (points - points[i]).norm(dim=1).argsort()[1 : neighbours + 1]
    unit = (points[near] - points[i])[:8].norm(dim=1).mean()
    ways = (points[near] - points[i]) / unit
    normal = torch.linalg.svd((ways - ways.mean(0)).double()).Vh[-1].float()
    normal = normal * (1 if (ways @ normal).sum() >= 0 else -1)
    return near, ways, unit, normal, (ways @ normal).square().mean().sqrt()


def slowly(fan, points, features, rate):
    """Place by place, for one row."""
    frames = [slow_frame(points, i, fan.neighbours) for i in range(len(points))]
    rings = next(rings for rings in range(1, 100) if rings * fan.spokes >= fan.surplus * rate)
    made = []
    for ring in range(1, rings + 1):
        share = FARTHEST * ring / rings
        for i, (near, ways, unit, normal, rough) in enumerate(frames):
            middle = ways.mean(0)
            for j, way in list(zip(near, ways, strict=True))[: fan.spokes]:
                _, ways_j, unit_j, normal_j, rough_j = frames[j]
                angles = [way @ normal, way @ normal_j, normal @ normal_j]
                ends = [(unit_j / unit).log(), rough_j - rough, way @ middle, way @ ways_j.mean(0)]
                edge = torch.stack([way.norm(), *angles, *ends])
                known = fan.here(features[i]) + fan.there(features[j]) + fan.edge(edge)
                along, across, up = fan.mlp(known + fan.share(torch.tensor([share, share**2])))
                flat = way - (way @ normal) * normal
                flat = flat / flat.norm()
                within = middle.norm() * (along * flat + across * torch.linalg.cross(normal, flat))
                made.append(points[i] + unit * (share * way + within + up * rough * normal))
    return torch.stack(made)


@given(seed=st.integers(0, 1000), n=st.integers(2, 40), rate=st.integers(1, 20))
@settings(max_examples=40)
@torch.no_grad()
def test_untrained_places_are_on_the_near_half_of_the_ways_to_neighbours(seed, n, rate):
    points, features = cloud(seed, n, rows=1)
    fan = Fan(WIDTHS)
    dense = fan(points, features, rate)[0].double()
    points, spokes = points[0].double(), min(8, n - 1)
    near = torch.cdist(points, points).argsort(1)[:, 1 : spokes + 1]
    for place in dense.view(-1, n, spokes, 3):  # ring by ring
        way = points[near] - points[:, None]
        share = ((place - points[:, None]) * way).sum(-1) / way.square().sum(-1)
        torch.testing.assert_close(place, points[:, None] + share[..., None] * way, atol=1e-5, rtol=0)
        assert share.min() > 0
        assert share.max() <= FARTHEST + 1e-4
    assert FARTHEST <= 0.45, "beyond half of the way lie the neighbour's own places"


@given(
    n=st.integers(2, 30),
    rate=st.integers(1, 40),
    spokes=st.integers(1, 12),
    surplus=st.sampled_from([1.0, 1.5, 2.0, 3.25]),
)
@torch.no_grad()
def test_at_any_rate_there_are_at_least_as_many_as_wanted_and_not_many_more(n, rate, spokes, surplus):
    points, features = cloud(n=n)
    fan = Fan(WIDTHS, hidden=4, spokes=spokes, surplus=surplus)
    dense = fan(points, features, rate)
    assert dense.shape[0] == 2
    assert dense.shape[1] >= surplus * rate * n >= rate * n
    assert dense.shape[1] < (surplus * rate + spokes) * n
    assert Trait.ANY_RATE in Fan.traits


@given(seed=st.integers(0, 1000), scale=st.floats(0.1, 10), rate=st.integers(1, 9))
@settings(max_examples=30)
@torch.no_grad()
def test_untrained_places_move_turn_and_scale_with_the_cloud(seed, scale, rate):
    points, features = cloud(seed)
    turn, shift = rotation(seed), torch.tensor([0.3, -0.2, 0.1])
    fan = Fan(WIDTHS)
    moved = fan(scale * points @ turn + shift, features, rate)
    torch.testing.assert_close(moved, scale * fan(points, features, rate) @ turn + shift, atol=1e-4 * scale, rtol=0)


@given(seed=st.integers(0, 1000), scale=st.floats(0.1, 10), rate=st.integers(1, 9))
@settings(max_examples=20)
@torch.no_grad()
def test_what_is_learned_moves_turns_and_scales_with_the_cloud(seed, scale, rate):
    points, features = cloud(seed, 60)
    points = nn.functional.normalize(points, dim=2)  # curved, so that it is certain which side is up
    turn, shift = rotation(seed), torch.tensor([0.3, -0.2, 0.1])
    fan = trained(seed)
    dense = fan(points, features, rate)
    assert (dense - Fan(WIDTHS)(points, features, rate)).abs().max() > 1e-3, "it has learned nothing"
    moved = fan(scale * points @ turn + shift, features, rate)
    torch.testing.assert_close(moved, scale * dense @ turn + shift, atol=2e-4 * scale, rtol=0)


@torch.no_grad()
def test_what_is_flat_stays_flat():
    points, features = cloud(n=40)
    points[..., 2] = 0
    assert trained()(points, features, 4)[..., 2].abs().max() < 1e-6


@pytest.mark.parametrize("rate", [1, 4, 7])
@torch.no_grad()
def test_it_equals_itself_place_by_place(rate):
    points, features = cloud(n=24)
    fan = trained()
    for b in range(2):
        torch.testing.assert_close(
            fan(points, features, rate)[b], slowly(fan, points[b], features[b], rate), atol=1e-5, rtol=1e-5
        )


def test_gradients_reach_the_features_and_every_weight_but_at_first_only_the_last_layer():
    points, features = cloud()
    features.requires_grad_()
    fan = trained()
    fan(points, features, 4).square().sum().backward()
    assert (features.grad != 0).any(2).all()
    assert all(weight.grad.abs().max() > 0 for weight in fan.parameters())
    new = Fan(WIDTHS)
    new(points, features, 4).square().sum().backward()
    assert new.mlp[-1].weight.grad.abs().max() > 0


@torch.no_grad()
def test_points_that_coincide_stay_finite():
    points, features = torch.zeros(1, 20, 3), torch.zeros(1, 20, CHANNELS)
    assert trained()(points, features, 4).isfinite().all()


def test_a_single_point_has_no_neighbours():
    points, features = cloud(n=1)
    with pytest.raises(UserError, match="2 neighbours were asked of 1 points"):
        Fan(WIDTHS)(points, features, 4)
