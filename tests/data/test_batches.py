"""Batches follow from seed, step and place alone."""

import dataclasses

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pcsr.data.batches import CONTRAST, JITTER, NOISE, NOISY, POOLS, SCALE, Batches, uneven_subset
from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.frames import UnitSphere
from tests.data.splits import clouds, split

ALL = ("redraw", "even", "crop", "rotate", "scale", "jitter", "noise", "uneven", "other-touches")


def batches(*augment: str, size: int = 4, touches: tuple[int, int] = (0, 3), seed: int = 5, count: int = 7) -> Batches:
    return Batches(split(count), size, touches, augment, seed)


@given(step=st.integers(0, 50))
def test_the_same_step_gives_the_same_batch_whatever_came_before(step):
    made = batches(*ALL)
    made.at(step + 1)
    for a, b in zip(clouds(made.at(step)), clouds(batches(*ALL).at(step)), strict=True):
        assert torch.equal(a, b)


def test_steps_and_seeds_differ():
    first = batches(*ALL).at(0).points
    assert not torch.equal(first, batches(*ALL).at(1).points)
    assert not torch.equal(first, batches(*ALL, seed=6).at(0).points)


@pytest.mark.parametrize(("size", "ranks"), [(4, 2), (6, 3), (6, 2), (4, 4), (1, 1)])
def test_the_shares_of_all_ranks_are_the_batch_of_one(size, ranks):
    made = batches(*ALL, size=size)
    for step in range(5):
        shares = [clouds(made.at(step, rank, ranks)) for rank in range(ranks)]
        for whole, *parts in zip(clouds(made.at(step)), *shares, strict=True):
            assert {len(part) for part in parts} == {size // ranks}
            assert torch.equal(torch.cat(parts), whole)


def test_an_epoch_shows_each_object_at_most_once_and_epochs_differ_in_order():
    made = batches(size=3)
    assert made.per_epoch == 2
    frames = [UnitSphere.fit(points.numpy()).normalize(points.numpy()) for points in made.split.points]
    seen = []
    for step in range(8):
        for row in made.at(step).points:
            (item,) = [i for i, frame in enumerate(frames) if np.array_equal(frame, row.numpy())]
            seen.append(item)
    epochs = [tuple(seen[i : i + 6]) for i in range(0, 24, 6)]
    assert all(len(set(epoch)) == 6 for epoch in epochs)
    assert len(set(epochs)) > 1


def test_each_batch_draws_its_own_number_of_touches():
    made = batches("redraw", "rotate", touches=(1, 3))
    counts = [made.at(step).touches.points.shape[1] for step in range(30)]
    assert set(counts) == {1, 2, 3}
    assert batches(*ALL, touches=(0, 0)).at(0).touches.points.shape == (4, 0, 8, 3)


def test_touches_of_a_row_are_different_touches_of_its_object():
    made = batches(touches=(3, 3), size=1, count=1)
    sphere = UnitSphere.fit(made.split.points[0].numpy())
    touched = made.at(0).touches.points[0]
    assert {touch.numpy().tobytes() for touch in touched} == {
        sphere.normalize(touch.numpy()).tobytes() for touch in made.split.touches[0]
    }


def test_other_touches_are_those_of_another_object_and_nothing_else_changes():
    own, other = batches(touches=(2, 2), size=1), batches("other-touches", touches=(2, 2), size=1)
    givers = set()
    for step in range(40):
        plain, swapped = own.at(step), other.at(step)
        assert torch.equal(swapped.points, plain.points)
        assert torch.equal(swapped.truth, plain.truth)
        (item,) = [i for i in range(7) if _is_of(plain.points[0], own.split.points[i])]
        sphere = UnitSphere.fit(own.split.points[item].numpy())
        touched = {touch.numpy().tobytes() for touch in swapped.touches.points[0]}
        (giver,) = [
            i
            for i in range(7)
            if touched <= {sphere.normalize(touch.numpy()).tobytes() for touch in own.split.touches[i]}
        ]
        assert giver != item
        givers.add(giver)
    assert len(givers) == 7


def test_a_single_object_has_no_other_touches_than_its_own():
    alone = batches("other-touches", touches=(3, 3), size=1, count=1)
    assert alone.at(0).touches.points.shape == (1, 3, 8, 3)


def _is_of(normalised, points):
    return np.array_equal(normalised.numpy(), UnitSphere.fit(points.numpy()).normalize(points.numpy()))


def test_the_sparse_cloud_fills_the_unit_sphere_and_is_part_of_the_truth():
    for augment in ((), ("redraw",)):
        batch = batches(*augment).at(0)
        torch.testing.assert_close(batch.points.norm(dim=-1).amax(1), torch.ones(4))
        torch.testing.assert_close(batch.points.mean(1), torch.zeros(4, 3), atol=1e-6, rtol=0)
        assert torch.cdist(batch.points, batch.truth).amin(2).max() < 2e-3  # cdist rounds small distances


def test_half_of_the_redrawn_clouds_are_even():
    def closest(cloud):
        return float((torch.cdist(cloud, cloud) + 9 * torch.eye(10)).min())

    random = [closest(p) for step in range(8) for p in batches("redraw", size=7).at(step).points]
    mixed = [closest(p) for step in range(8) for p in batches("redraw", "even", size=7).at(step).points]
    far = sum(gap > max(random) for gap in mixed)
    assert 0.25 * len(mixed) < far < 0.75 * len(mixed)


def test_redraw_takes_other_points_each_time_and_none_twice():
    first, second = batches("redraw", size=7).at(0).points, batches("redraw", size=7).at(1).points
    assert all(len(row.unique(dim=0)) == 10 for row in first)
    assert not any(torch.equal(a, b) for a in first for b in second)


def turns(seed: int, count: int) -> np.ndarray:
    """The rotations of a batch of so many objects, from what they do to the truth."""
    few = split(count)
    few = dataclasses.replace(few, truth=[truth[:14] for truth in few.truth])
    still, moved = (Batches(few, count, (0, 0), augment, seed).at(0).truth.double() for augment in ((), ("rotate",)))
    return torch.linalg.lstsq(still, moved).solution.numpy()


@given(seed=st.integers(0, 2**32 - 1))
def test_a_rotation_keeps_lengths_and_handedness(seed):
    (turn,) = turns(seed, 1)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(turn) == pytest.approx(1, abs=1e-6)


@pytest.mark.slow
def test_rotations_have_no_favourite_direction():
    turned = turns(0, 4000)
    assert np.abs(turned.mean(0)).max() < 0.05  # standard error of an entry: 0.577 / sqrt(4000) = 0.009
    np.testing.assert_allclose((turned**2).mean(0), 1 / 3, atol=0.03)


@pytest.mark.parametrize("augment", [("rotate",), ("scale",), ("rotate", "scale")])
def test_all_clouds_of_a_row_move_together(augment):
    still, moved = batches(touches=(2, 2)).at(0), batches(*augment, touches=(2, 2)).at(0)
    for row in range(4):
        a = torch.cat([still.points[row], still.touches.points[row].flatten(0, 1), still.truth[row]]).double()
        b = torch.cat([moved.points[row], moved.touches.points[row].flatten(0, 1), moved.truth[row]]).double()
        change = torch.linalg.lstsq(a, b).solution
        torch.testing.assert_close(a @ change, b, atol=1e-5, rtol=0)
        square = change @ change.T
        torch.testing.assert_close(square, square[0, 0] * torch.eye(3).double(), atol=1e-5, rtol=0)
        factor = float(square[0, 0]) ** 0.5
        assert torch.linalg.det(change) > 0
        assert factor == pytest.approx(1, abs=1e-5) if "scale" not in augment else SCALE[0] <= factor <= SCALE[1]
        assert not torch.allclose(change, torch.eye(3).double(), atol=1e-3)


def test_jitter_moves_the_sparse_cloud_alone_and_little():
    still, moved = batches(touches=(2, 2)).at(0), batches("jitter", touches=(2, 2)).at(0)
    assert torch.equal(still.truth, moved.truth)
    assert torch.equal(still.touches.points, moved.touches.points)
    noise = moved.points - still.points
    assert noise.abs().max() <= 3 * JITTER + 1e-6
    assert float(noise.std()) == pytest.approx(JITTER, rel=0.3)


def test_without_patches_every_touch_is_there():
    assert batches(touches=(2, 2)).at(0).touches.mask.all()


@given(seed=st.integers(0, 1000))
def test_even_clouds_are_farthest_points_of_one_of_the_pools(seed):
    """What is drawn from a pool spreads the less, the smaller the pool: both ends of it are met."""
    truth = np.random.default_rng(seed).normal(size=(400, 3))
    made = batches("redraw", "even")
    rng = np.random.default_rng(seed)
    index = made._redrawn(truth, 20, rng)
    assert len(set(index.tolist())) == 20
    again = np.random.default_rng(seed)
    if again.random() < 0.5:
        pool = again.permutation(400)[: int(again.choice(POOLS)) * 20]
        start = int(again.integers(len(pool)))
        assert index.tolist() == pool[farthest_points(truth[pool], 20, start=start)].tolist()
    else:
        assert index.tolist() == again.choice(400, 20, replace=False).tolist()


def test_pools_of_all_sizes_are_drawn_from_and_never_more_than_there_is():
    def least(index):
        apart = np.linalg.norm(truth[index][:, None] - truth[index][None], axis=2)
        return (apart + 9 * np.eye(len(index))).min()

    truth = np.random.default_rng(0).normal(size=(60, 3))
    made = batches("redraw", "even")
    assert len(made._redrawn(truth, 59, np.random.default_rng(0))) == 59
    truth = np.random.default_rng(0).normal(size=(400, 3))
    gaps = [least(made._redrawn(truth, 20, np.random.default_rng(seed))) for seed in range(60)]
    of_all = least(farthest_points(truth, 20))
    assert sum(gap > 0.8 * of_all for gap in gaps) > 3
    assert sum(0.3 * of_all < gap < 0.7 * of_all for gap in gaps) > 3


def test_noise_displaces_some_clouds_by_up_to_three_of_its_largest_deviations_and_leaves_the_truth():
    still, moved = batches(touches=(0, 0), size=16), batches("noise", touches=(0, 0), size=16)
    away = []
    for step in range(8):
        one, other = still.at(step), moved.at(step)
        assert torch.equal(one.truth, other.truth)
        away += (one.points - other.points).abs().amax((1, 2)).tolist()
    share = np.mean(np.array(away) > 0)
    assert 0 < share < 1
    assert abs(share - NOISY) < 0.25
    assert max(away) <= 3 * NOISE[1]
    assert min(each for each in away if each > 0) > NOISE[0]


def test_an_uneven_subset_is_denser_on_one_side_by_no_more_than_the_contrast():
    rng = np.random.default_rng(0)
    truth = rng.uniform(-1, 1, (20_000, 3))
    ratios = []
    for _ in range(10):
        chosen = truth[uneven_subset(truth, 4000, rng)]
        assert len(np.unique(chosen, axis=0)) == 4000
        middle = chosen.mean(0)
        along = middle / np.linalg.norm(middle)
        counts = np.histogram(chosen @ along, bins=[-1, -0.5, 0, 0.5, 1])[0]
        ratios.append(counts[3] / max(counts[0], 1))
    assert max(ratios) > 1.5
    assert max(ratios) < CONTRAST
