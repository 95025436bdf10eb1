"""Batches follow from seed, step and place alone."""

import dataclasses

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pcsr.data.batches import CROPPED, JITTER, POOLS, SCALE, Batches, _is_part, _rotation
from pcsr.data.dataset import Split
from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.frames import UnitSphere
from pcsr.recipe import Patches

ALL = ("redraw", "even", "crop", "rotate", "scale", "jitter")


def split(count: int = 7) -> Split:
    random = torch.Generator().manual_seed(1)
    truth = torch.randn(count, 40, 3, generator=random)
    return Split(
        names=[f"object {i}" for i in range(count)],
        groups=["all"] * count,
        truth=list(truth),
        points=list(truth[:, :10].clone()),
        touches=list(torch.randn(count, 3, 8, 3, generator=random)),
        spheres=[UnitSphere(np.zeros(3), 1.0)] * count,
        felt=[(0.1, 0.2, 0.3)] * count,
        about={},
    )


def batches(*augment: str, size: int = 4, touches: tuple[int, int] = (0, 3), seed: int = 5, count: int = 7) -> Batches:
    return Batches(split(count), size, touches, augment, seed)


def clouds(batch):
    return batch.points, batch.touches.points, batch.touches.mask, batch.truth


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
    frames = [UnitSphere.fit(points.numpy()).apply(points.numpy()) for points in made.split.points]
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
    felt = made.at(0).touches.points[0]
    assert {touch.numpy().tobytes() for touch in felt} == {
        sphere.apply(touch.numpy()).tobytes() for touch in made.split.touches[0]
    }


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


@given(seed=st.integers(0, 2**32 - 1))
def test_a_rotation_keeps_lengths_and_handedness(seed):
    turn = _rotation(np.random.default_rng(seed)).astype(np.float64)
    np.testing.assert_allclose(turn @ turn.T, np.eye(3), atol=1e-6)
    assert np.linalg.det(turn) == pytest.approx(1, abs=1e-6)


def test_rotations_have_no_favourite_direction():
    rng = np.random.default_rng(0)
    turns = np.stack([_rotation(rng) for _ in range(4000)])
    assert np.abs(turns.mean(0)).max() < 0.05  # standard error of an entry: 0.577 / sqrt(4000) = 0.009
    np.testing.assert_allclose((turns**2).mean(0), 1 / 3, atol=0.03)


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


PATCHES = Patches.model_construct(points=5, rate=3, cover=3.0)


def patched(*augment, touches=(0, 3), seed=5):
    return Batches(split(), 4, touches, augment, seed, PATCHES)


@given(seed=st.integers(0, 20))
def test_a_patch_is_the_neighbourhood_of_a_point_and_its_sparse_cloud_part_of_it(seed):
    made = patched(touches=(0, 0), seed=seed)
    batch = made.at(0)
    assert batch.points.shape == (4, 5, 3)
    assert batch.truth.shape == (4, 15, 3)
    for points, truth in zip(batch.points, batch.truth, strict=True):
        whole = truth[torch.cdist(points, truth).argmin(1)]
        torch.testing.assert_close(points, whole, atol=1e-5, rtol=0)
    order = np.random.default_rng((seed, 0)).permutation(7)[:4]
    for item, truth in zip(order, batch.truth, strict=True):
        _assert_a_neighbourhood(made.split.truth[item], truth)


def _assert_a_neighbourhood(whole, patch):
    """Up to scale and place, the patch is some point's 15 nearest."""
    spread = torch.cdist(patch, patch)
    for seed in range(len(whole)):
        near = whole[(whole - whole[seed]).norm(dim=1).argsort()[:15]]
        own = torch.cdist(near, near)
        if torch.allclose((own / own.max()).sort().values, (spread / spread.max()).sort().values, atol=1e-3):
            return
    raise AssertionError("no point has these for its nearest")


def test_some_touches_belong_to_a_patch_and_some_do_not():
    made = patched("rotate", "scale", touches=(3, 3))
    masks = torch.cat([made.at(step).touches.mask for step in range(30)])
    assert masks.shape[1] == 3
    assert 0 < masks.float().mean() < 1


def test_many_patches_are_around_a_touch():
    given = split()
    felt = [0.01 * touch + truth[0] for touch, truth in zip(given.touches, given.truth, strict=True)]
    far = dataclasses.replace(given, touches=felt)
    made = Batches(far, 7, (1, 1), (), 0, PATCHES)
    at_touch = [row.any() for step in range(20) for row in made.at(step).touches.mask]
    assert 0.5 < np.mean(at_touch) < 1


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


# --- crops


def ball(count: int = 5, *, seen: bool = False) -> Split:
    """Balls, evenly sampled; a sparse cloud that was `seen` is no part of the truth."""
    random = torch.Generator().manual_seed(2)
    many = torch.nn.functional.normalize(torch.randn(count, 1000, 3, generator=random), dim=2)
    truth = torch.stack([one[torch.from_numpy(farthest_points(one.numpy(), 200))] for one in many])
    points = truth[:, :40] + 0.001 * seen  # the farthest are the first
    return dataclasses.replace(split(count), truth=list(truth), points=list(points))


def cropped_and_whole(made: Batches, steps: int = 40):
    shown = [made.at(step) for step in range(steps)]
    crops = [batch for batch in shown if batch.truth.shape[1] < 200]
    return crops, [batch for batch in shown if batch.truth.shape[1] == 200]


def test_a_share_of_the_batches_is_cropped_and_the_others_are_as_without():
    made = Batches(ball(), 2, (0, 3), ("crop",), 0)
    crops, whole = cropped_and_whole(made, 200)
    assert len(crops) == pytest.approx(200 * CROPPED, abs=25)  # four standard deviations
    assert all(batch.points.shape[1] == 20 and batch.truth.shape[1] == 100 for batch in crops)
    assert all(batch.touches.mask.all() for batch in whole)
    plain = Batches(ball(), 2, (0, 3), (), 0)
    for step in range(40):
        batch = made.at(step)
        if batch.truth.shape[1] == 200:
            assert all(torch.equal(a, b) for a, b in zip(clouds(batch), clouds(plain.at(step)), strict=True))


@pytest.mark.parametrize("augment", [("crop",), ("crop", "redraw"), ("crop", "redraw", "even")])
def test_a_crop_is_one_side_of_the_object_and_its_cloud_is_drawn_from_it(augment):
    crops, _ = cropped_and_whole(Batches(ball(), 2, (0, 0), augment, 0))
    assert crops
    for batch in crops:
        for points, truth in zip(batch.points, batch.truth, strict=True):
            # The nearest half of a ball is a cap: a plane parts it from the rest, and it is half as high as it is wide.
            centred = (truth - truth.mean(0)).double()
            height, *width = torch.linalg.svdvals(centred)[[2, 1, 0]]
            assert height < 0.75 * min(width)
            apart = torch.cdist(points, truth, compute_mode="donot_use_mm_for_euclid_dist")
            assert len(points) - int((apart.amin(1) < 1e-5).sum()) <= (0 if "redraw" in augment else 3)
            spread = torch.linalg.svdvals((points - points.mean(0)).double()) / len(points) ** 0.5
            torch.testing.assert_close(spread, torch.linalg.svdvals(centred) / 10, rtol=0.5, atol=0)


def test_a_cropped_batch_has_no_touches_and_the_others_have_theirs():
    crops, whole = cropped_and_whole(Batches(ball(), 2, (3, 3), ("crop", "redraw"), 0))
    assert {tuple(batch.touches.points.shape) for batch in crops} == {(2, 0, 8, 3)}
    assert {tuple(batch.touches.mask.shape) for batch in crops} == {(2, 0)}
    assert {tuple(batch.touches.points.shape) for batch in whole} == {(2, 3, 8, 3)}


def test_a_patch_is_a_part_already_and_never_cropped():
    made, plain = (Batches(ball(), 2, (2, 2), augment, 0, PATCHES) for augment in (("crop",), ()))
    for step in range(20):
        assert all(torch.equal(a, b) for a, b in zip(clouds(made.at(step)), clouds(plain.at(step)), strict=True))


def flatness(cloud):
    """How thick a cloud is, as a share of its width: about 1 of a ball, and a half of half of one."""
    thick = torch.linalg.svdvals((cloud - cloud.mean(0)).double())
    return float(thick[2] / thick[0])


@pytest.mark.parametrize("augment", [("crop",), ("crop", "redraw", "even")])
def test_what_a_camera_saw_is_thinned_and_neither_cut_nor_drawn_anew(augment):
    made = Batches(ball(seen=True), 2, (3, 3), augment, 0)
    crops, whole = cropped_and_whole(made)
    assert crops
    assert all(batch.points.shape[1] == 20 and batch.truth.shape[1] == 100 for batch in crops)
    assert all(flatness(truth) > 0.7 for batch in crops for truth in batch.truth)
    assert np.mean([flatness(points) for batch in crops for points in batch.points]) > 0.6
    # Whatever was drawn from the truth would lie on it; this lies beside it, as far as it did.
    for batch in crops + whole:
        apart = torch.cdist(batch.points, batch.truth, compute_mode="donot_use_mm_for_euclid_dist")
        assert apart.min() > 5e-4


def test_a_cloud_is_part_of_the_truth_it_was_drawn_from():
    given, seen = ball(), ball(seen=True)
    assert all(map(_is_part, given.points, given.truth))
    assert not any(map(_is_part, seen.points, seen.truth))
    assert not _is_part(given.points[0], given.truth[1])


def test_redraw_never_redraws_what_a_camera_saw_though_it_does_others():
    """Data sets of mixed sampling have both."""
    given, seen = ball(), ball(seen=True)
    mixed = dataclasses.replace(given, points=[*given.points[:2], *seen.points[2:]])
    made = Batches(mixed, 5, (0, 0), ("redraw", "even"), 0)
    order = np.random.default_rng((0, 0)).permutation(5)
    for item, points in zip(order, made.at(0).points, strict=True):
        as_built = UnitSphere.fit(mixed.points[item].numpy()).apply(mixed.points[item].numpy())
        assert np.array_equal(points.numpy(), as_built) == (item >= 2)
