"""`edge-conv`: each visual point uses the touched points nearest to it, whatever others there are."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn
from torch.nn import functional as F

from pcsr import Fusion, TouchBatch, Trait, Widths
from pcsr.testing import checks_for
from pcsr_plugins.fusions.edge_conv import EdgeConvFusion

WIDTHS = Widths(visual=6, touch=4)
N = 15


def made(seed=0, **options):
    """One that has learned something: as it is built, nothing is added."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        fusion = EdgeConvFusion(WIDTHS, hidden=10, **options)
        nn.init.normal_(fusion.out.weight)
    return fusion


def given_clouds(seed=0, touches=3, points=9, rows=2):
    random = torch.Generator().manual_seed(seed)
    cloud, features = torch.randn(rows, N, 3, generator=random), torch.randn(rows, N, 6, generator=random)
    touched = torch.randn(rows, touches, points, 3, generator=random)
    message = torch.randn(rows, touches, points, 4, generator=random)
    return cloud, features, TouchBatch(touched, message, torch.ones(rows, touches, dtype=torch.bool))


def close(a, b):
    torch.testing.assert_close(a, b, atol=1e-5, rtol=1e-5)


def slowly(fusion, points, features, touches):
    """The line of the module's docstring for one visual point after the other; every touched point can be used."""
    rows = []
    for b in range(len(points)):
        touched, message = (
            touches.points[b, touches.mask[b]].flatten(0, 1),
            touches.features[b, touches.mask[b]].flatten(0, 1),
        )
        for p, f in zip(points[b], features[b], strict=True):
            edges = []
            for j in (touched - p).norm(dim=1).argsort()[: fusion.neighbours]:
                way = touched[j] - p
                edges.append(
                    F.relu(fusion.here(f) + fusion.there(message[j]) + fusion.way(torch.cat([way, way.norm()[None]])))
                )
            rows.append(f + fusion.out(torch.stack(edges).max(0).values))
    return torch.stack(rows).view_as(features)


def test_it_claims_what_the_host_acts_on():
    assert EdgeConvFusion.traits == {Trait.PERMUTATION_EQUIVARIANT, Trait.TOUCH_PERMUTATION_INVARIANT}
    assert EdgeConvFusion.keeps_touched_points
    assert EdgeConvFusion.uses_touch_features
    assert not Fusion.keeps_touched_points


def test_the_result_may_be_without_touched_points():
    without, usual = made(keeps_touched_points=False), made()
    assert not without.keeps_touched_points
    assert usual.keeps_touched_points
    assert torch.equal(without(*given_clouds()), usual(*given_clouds()))


@pytest.mark.parametrize("check", checks_for(EdgeConvFusion, keeps_touched_points=False), ids=str)
def test_it_is_a_good_part_without_touched_points_in_the_result(check):
    check()


def test_as_it_is_built_it_adds_nothing():
    points, features, touches = given_clouds()
    assert torch.equal(EdgeConvFusion(WIDTHS)(points, features, touches), features)


@given(seed=st.integers(0, 100), neighbours=st.integers(1, 12))
@settings(max_examples=15)
@torch.no_grad()
def test_it_is_the_line_of_its_docstring(seed, neighbours):
    points, features, touches = given_clouds(seed)
    touches.mask[0, seed % 3] = False
    fusion = made(seed, neighbours=neighbours)
    close(fusion(points, features, touches), slowly(fusion, points, features, touches))


@given(seed=st.integers(0, 100), count=st.integers(1, 12))
@settings(max_examples=15)
@torch.no_grad()
def test_neither_the_order_of_touches_nor_that_of_their_points_matters(seed, count):
    points, features, touches = given_clouds(seed)
    touches.mask[0, 1] = False
    random = torch.Generator().manual_seed(seed)
    a, m = torch.randperm(3, generator=random), torch.randperm(9, generator=random)
    other = TouchBatch(touches.points[:, a][:, :, m], touches.features[:, a][:, :, m], touches.mask[:, a])
    fusion = made(points_per_touch=count)
    close(fusion(points, features, other), fusion(points, features, touches))


@torch.no_grad()
def test_visual_points_are_used_in_any_order():
    points, features, touches = given_clouds()
    order, fusion = torch.randperm(N, generator=torch.Generator().manual_seed(1)), made()
    close(fusion(points[:, order], features[:, order], touches), fusion(points, features, touches)[:, order])


@torch.no_grad()
def test_what_stands_in_the_place_of_a_missing_touch_is_not_used():
    points, features, touches = given_clouds()
    mask = torch.tensor([[True, False, True], [False, False, True]])
    fusion = made(neighbours=20)
    there = fusion(points, features, TouchBatch(touches.points, touches.features, mask))
    other, message = touches.points.clone(), touches.features.clone()
    other[~mask], message[~mask] = 0.01, 99.0
    assert torch.equal(fusion(points, features, TouchBatch(other, message, mask)), there)
    alone = TouchBatch(touches.points[:1, [0, 2]], touches.features[:1, [0, 2]], mask[:1, [0, 2]])
    close(fusion(points[:1], features[:1], alone), there[:1])


def test_a_missing_touch_gets_no_gradient_and_does_no_harm():
    points, features, touches = given_clouds()
    mask = torch.tensor([[True, False, True], [True, True, False]])
    message = touches.features.clone().requires_grad_()
    points.requires_grad_()
    points.data[0, 0] = touches.points[0, 0, 0]  # a way of no length
    fusion = made(neighbours=30)
    fusion(points, features, TouchBatch(touches.points, message, mask)).square().sum().backward()
    assert message.grad[~mask].abs().max() == 0
    assert (message.grad[mask] != 0).flatten(1).any(1).all()
    for grad in (points.grad, *(weight.grad for weight in fusion.parameters())):
        assert grad.isfinite().all()
        assert grad.abs().max() > 0


@torch.no_grad()
def test_only_the_nearest_are_used():
    points, features, touches = given_clouds(touches=1)
    fusion = made(neighbours=4)
    before = fusion(points, features, touches)
    nearest = torch.cdist(points[0], touches.points[0, 0]).argsort(1)[:, :4]
    for j in range(9):
        message = touches.features.clone()
        message[0, 0, j] += 100.0
        moved = (fusion(points, features, TouchBatch(touches.points, message, touches.mask)) != before)[0].any(1)
        near = (nearest == j).any(1)
        assert not moved[~near].any()
        # 100 more of everything is louder, or softer, than all others in some channel.
        assert moved[near].all()


@torch.no_grad()
def test_of_a_dense_touch_points_spread_over_it_are_used():
    points, features, _ = given_clouds(rows=1)
    line = torch.zeros(1, 1, 400, 3)
    line[..., 0] = torch.linspace(0, 1, 400)
    message = torch.randn(1, 1, 400, 4, generator=torch.Generator().manual_seed(0))
    fusion, there = made(points_per_touch=8, neighbours=8), torch.ones(1, 1).bool()
    before = fusion(points, features, TouchBatch(line, message, there))
    louder = message[:, 0] + 100.0 * torch.eye(400).unsqueeze(-1)  # in each row another touched point
    rows = (points.expand(400, -1, -1), features.expand(400, -1, -1))
    after = fusion(*rows, TouchBatch(line.expand(400, -1, -1, -1), louder.unsqueeze(1), there.expand(400, 1)))
    used = (after - before).abs().flatten(1).amax(1) > 1e-2
    assert used.sum() == 8
    assert (line[0, 0, :, :1] - line[0, 0, used, 0]).abs().amin(1).max() < 0.15
    few = TouchBatch(line[:, :, used], message[:, :, used], there)
    close(fusion(points, features, few), before)  # features go with their points


@pytest.mark.parametrize("points", [1, 2, 30])
@torch.no_grad()
def test_touches_may_have_any_number_of_points(points):
    cloud, features, touches = given_clouds(points=points, touches=1)
    fused = made()(cloud, features, touches)
    assert fused.shape == features.shape
    assert fused.isfinite().all()
