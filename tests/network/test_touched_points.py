"""Touched points in the place of what the network made around them."""

from collections import Counter

import pytest
import torch

from pcsr.contracts import TouchBatch
from pcsr.geometry.anchoring import even_subset
from pcsr.network.network import Network
from tests.small_network import NO_FUSION, RATE, N, network


@pytest.fixture
def clouds():
    random = torch.Generator().manual_seed(3)
    points = torch.randn(4, N, 3, generator=random)
    points = points / points.norm(dim=-1).amax(1)[:, None, None]
    return points, torch.randn(4, 3, 12, 3, generator=random) / 3


FAN = ("model.upsampler={use: edge-offsets, hidden: 8}",)
ANCHORED = ("model.fusion={use: edge-conv, hidden: 8}", *FAN)
FEATURES = ("model.fusion={use: edge-conv, hidden: 8, keeps_touched_points: false}", *FAN)
COUNT = RATE * N


def anchored(*overrides: str) -> Network:
    """One whose fusion and upsampler have learned something."""
    net = network(*(overrides or ANCHORED))
    with torch.no_grad(), torch.random.fork_rng():
        torch.manual_seed(0)
        for weight in (net.fusion.out.weight, net.upsampler.mlp[-1].weight):
            weight.normal_(std=0.05)
    return net


def rows_of(cloud):
    return {tuple(point) for point in cloud.tolist()}


INSERTED = ("model.fusion=joint-cloud", "model.touch_encoder=null", *FAN)


@pytest.mark.parametrize(
    "overrides", [ANCHORED, (ANCHORED[0],), (*FAN, "model.fusion=iterative"), (*NO_FUSION, *FAN), INSERTED]
)
@torch.no_grad()
def test_in_use_there_are_just_as_many_points_as_wanted(clouds, overrides):
    points, touches = clouds
    net = network(*overrides)
    mask = torch.tensor([[True, False, True], [False, False, False], [True, True, True], [False, True, False]])
    for touch in (None, TouchBatch.of(touches[:, :0]), TouchBatch.of(touches)):
        assert net(points, RATE, touch).shape == (4, COUNT, 3)
        assert net.stages(points, RATE, touch)[-1].shape == (4, COUNT, 3)
    if net.fusion.uses_touch_features:  # a fusion that joins touches wants as many in each row
        assert net(points, RATE, TouchBatch.of(touches, mask)).shape == (4, COUNT, 3)


@pytest.mark.parametrize(
    ("overrides", "keeps_touched_points"),
    [
        (ANCHORED, True),
        (FEATURES, False),
        (INSERTED, True),
        ((*NO_FUSION, *FAN), False),
        ((*FAN, "model.fusion=iterative"), False),
    ],
)
@torch.no_grad()
def test_candidates_are_all_that_is_made_and_touched_of_which_in_use_the_farthest_are_kept(
    clouds, overrides, keeps_touched_points
):
    points, touches = clouds
    net = network(*overrides)
    for touch in (None, TouchBatch.of(touches)):
        made = net.upsampler(*net.refine(points, touch), RATE)
        every, errors = net.candidates(points, RATE, touch)
        assert errors is None, "this upsampler predicts none"
        assert every.shape[1] > COUNT
        assert torch.equal(every[:, : made.shape[1]], made)
        known = every[:, made.shape[1] :]
        assert torch.equal(
            known, touches.flatten(1, 2) if keeps_touched_points and touch is not None else points[:, :0]
        )
        both = torch.cat([known, made], dim=1)
        for row, kept in zip(both, net(points, RATE, touch), strict=True):
            assert torch.equal(row[torch.from_numpy(even_subset(row.numpy(), COUNT, known.shape[1]))], kept)


@torch.no_grad()
def test_candidates_repeat_points_in_the_place_of_a_missing_touch(clouds):
    points, touches = clouds
    mask = torch.tensor([[True, False, True], [False, False, False], [True, True, True], [False, True, False]])
    net = anchored()
    every = net.candidates(points, RATE, TouchBatch.of(touches, mask))[0]
    present = net.candidates(points, RATE, TouchBatch.of(touches, mask | True))[0]
    assert torch.equal(net.candidates(points, RATE, TouchBatch.of(touches))[0], present)
    for row, touch, there in zip(every, touches, mask, strict=True):
        own, joined = rows_of(row[:-36]), row[-36:].view(3, 12, 3)
        assert torch.equal(joined[there], touch[there])
        assert rows_of(joined[~there].flatten(0, 1)) <= own
    net.train()
    for row, judged in zip(every, net(points, RATE, TouchBatch.of(touches, mask)), strict=True):
        assert rows_of(judged) <= rows_of(row), "training judges candidates, and no other points"


@torch.no_grad()
def test_of_an_upsampler_without_surplus_candidates_are_the_result(clouds):
    points, touches = clouds
    net = network()
    given = TouchBatch.of(touches)
    assert torch.equal(net.candidates(points, RATE, given)[0], net(points, RATE, given))


@torch.no_grad()
def test_predicted_errors_are_of_the_candidates_and_zero_for_touched_points(clouds):
    points, touches = clouds
    net = network(*INSERTED[:-1], "model.upsampler={use: rated-edges, hidden: 8}")
    dense, errors = net.candidates(points, RATE, TouchBatch.of(touches))
    assert errors.shape == dense.shape[:2]
    touched = touches.shape[1] * touches.shape[2]
    assert (errors[:, :-touched] > 0).all()
    assert (errors[:, -touched:] == 0).all()


@torch.no_grad()
def test_in_training_a_surplus_is_dropped_at_random_the_same_at_every_call(clouds):
    points, _ = clouds
    net = anchored()
    made = net.upsampler(*net.refine(points), RATE)
    state = torch.get_rng_state()
    kept = net.train()(points, RATE)
    assert kept.shape == (4, COUNT, 3)
    assert torch.equal(net(points, RATE), kept)
    assert torch.equal(torch.get_rng_state(), state)
    assert made.shape[1] > 2 * COUNT
    taken = [[row.index(point) for point in few] for row, few in zip(made.tolist(), kept.tolist(), strict=True)]
    for row, few in zip(made, kept, strict=True):
        assert Counter(map(tuple, few.tolist())) <= Counter(map(tuple, row.tolist())), "no place more often than made"
    share = torch.tensor(taken).float() / made.shape[1]
    torch.testing.assert_close(share.histc(4, 0, 1) / share.numel(), torch.full((4,), 0.25), atol=0.1, rtol=0)


@torch.no_grad()
def test_in_training_every_touched_point_is_there(clouds):
    points, touches = clouds
    net = anchored().train()
    mask = torch.tensor([[True, False, True]] * 4)
    dense = net(points, RATE, TouchBatch.of(touches, mask))
    assert dense.shape == (4, COUNT + 36, 3)
    for row, touch, there in zip(dense, touches, mask, strict=True):
        own, joined = rows_of(row[:-36]), row[-36:].view(3, 12, 3)
        assert torch.equal(joined[there], touch[there])
        assert rows_of(joined[~there].flatten(0, 1)) <= own, "a missing touch repeats points of the cloud"


@torch.no_grad()
def test_in_training_there_are_as_many_for_each_point_that_joined(clouds):
    points, touches = clouds
    assert network(*NO_FUSION, *FAN).train()(points, RATE, TouchBatch.of(touches)).shape == (4, RATE * (N + 36), 3)
    assert network(*INSERTED).train()(points, RATE, TouchBatch.of(touches)).shape == (4, RATE * (N + 36) + 36, 3)


@torch.no_grad()
def test_a_touched_region_consists_of_touched_points(clouds):
    points, touches = clouds
    net = anchored()
    dense, alone = net(points, RATE, TouchBatch.of(touches)), net(points, RATE)
    for row, touch, visual in zip(dense, touches.flatten(1, 2), alone, strict=True):
        guessed = torch.stack([point for point in row if tuple(point.tolist()) not in rows_of(touch)])
        assert len(guessed) < len(row), "no touched point is there"
        around = torch.cdist(guessed, touch).min()
        assert around > 2 * torch.cdist(visual, touch).min(), "without anchors some would be nearer"


@torch.no_grad()
def test_with_anchors_zero_touches_are_no_touches_bit_for_bit(clouds):
    points, touches = clouds
    for net in (anchored(), network(ANCHORED[0])):
        alone = net(points, RATE)
        assert torch.equal(net(points, RATE, TouchBatch.of(touches[:, :0])), alone)
        assert torch.equal(net(points, RATE, TouchBatch.of(touches, torch.zeros(4, 3, dtype=torch.bool))), alone)
        assert not torch.equal(net(points, RATE, TouchBatch.of(touches)), alone)


@torch.no_grad()
def test_with_anchors_rows_are_independent_and_missing_touches_leave_no_trace(clouds):
    points, touches = clouds
    mask = torch.tensor([[True, False, True], [False, False, False], [True, True, True], [False, True, False]])
    other = touches.clone()
    other[~mask] = 0.5
    for net in (anchored(), anchored(ANCHORED[0], "model.upsampler.start=neighbours")):
        mixed = net(points, RATE, TouchBatch.of(touches, mask))
        assert torch.equal(net(points, RATE, TouchBatch.of(other, mask)), mixed)
        for row, (cloud, touch, there) in enumerate(zip(points, touches, mask, strict=True)):
            alone = net(cloud[None], RATE, TouchBatch.of(touch[there][None]) if there.any() else None)[0]
            torch.testing.assert_close(mixed[row], alone, atol=1e-5, rtol=0)


@torch.no_grad()
def test_with_anchors_the_order_of_points_and_touches_does_not_matter(clouds):
    points, touches = clouds
    random = torch.Generator().manual_seed(5)
    n, a, m = (torch.randperm(count, generator=random) for count in (N, 3, 12))
    net = anchored()
    before = net(points, RATE, TouchBatch.of(touches))
    after = net(points[:, n], RATE, TouchBatch.of(touches[:, a][:, :, m]))
    apart = torch.cdist(before, after, compute_mode="donot_use_mm_for_euclid_dist")
    for nearest in (apart.amin(1), apart.amin(2)):  # where two are equally far, rounding decides who stays
        assert (nearest < 1e-4).float().mean() > 0.95


@pytest.mark.parametrize("training", [True, False])
def test_with_anchors_gradients_reach_every_weight(clouds, training):
    points, touches = clouds
    net = anchored().train(training)
    mask = torch.tensor([[True, True, True], [False, False, False], [True, False, False], [True, True, False]])
    (net(points, RATE, TouchBatch.of(touches, mask)) ** 2).sum().backward()
    for name, weight in net.named_parameters():
        assert weight.grad is not None, name
        assert weight.grad.isfinite().all(), name
    for part in (net.touch_encoder, net.encoder, net.fusion, net.backbone, net.upsampler):
        assert any(weight.grad.abs().max() > 0 for weight in part.parameters())


@torch.no_grad()
def test_few_touched_points_never_leave_too_few_points(clouds):
    """A touched point takes the place of all around it: of an upsampler without surplus none may be left over."""
    points, touches = clouds
    assert network(ANCHORED[0])(points, RATE, TouchBatch.of(touches[:, :1, :2])).shape == (4, COUNT, 3)
