"""Batches of halves of objects, and of clouds that a camera saw."""

import dataclasses

import numpy as np
import pytest
import torch

from pcsr.data.batches import CROPPED, Batches
from pcsr.data.dataset import Split
from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.frames import UnitSphere
from tests.data.splits import PATCHES, clouds, split


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


def test_redraw_never_redraws_what_a_camera_saw_though_it_does_others():
    """Data sets of mixed sampling have both. The last cloud was drawn from the truth of another object."""
    given, seen = ball(), ball(seen=True)
    mixed = dataclasses.replace(given, points=[*given.points[:2], *seen.points[2:4], given.points[0]])
    made = Batches(mixed, 5, (0, 0), ("redraw", "even"), 0)
    order = np.random.default_rng((0, 0)).permutation(5)
    for item, points in zip(order, made.at(0).points, strict=True):
        as_built = UnitSphere.fit(mixed.points[item].numpy()).normalize(mixed.points[item].numpy())
        assert np.array_equal(points.numpy(), as_built) == (item >= 2)
