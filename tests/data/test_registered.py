"""Touches that are registered to the sparse cloud: corrected, with fewer points, or refused."""

import dataclasses

import numpy as np
import pytest
import torch
import trimesh

import pcsr.data.sample
from pcsr import ShapeItem, Touch, TouchSource, UserError
from pcsr.clouds.pose_error import PoseError
from pcsr.data.batches import Batches
from pcsr.data.dataset import Split
from pcsr.data.sample import covered, make_sample
from pcsr.data.shards import shard_path, write_shard
from pcsr.registration import RegisteredTouch, Registration
from tests.data.splits import PATCHES, split
from tests.data.test_shards import manifest, sample

BALL = ShapeItem("ball", "balls", trimesh.creation.icosphere(subdivisions=4, radius=2.0))
SIZE = 30


class Patches(TouchSource):
    """Touches of the points around some vertices, whose order is random."""

    def touches(self, item, cloud, count, seed):
        rng, points = np.random.default_rng(seed), item.mesh.vertices
        middles = points[rng.integers(len(points), size=count)]
        near = [np.linalg.norm(points - middle, axis=1).argsort()[:SIZE] for middle in middles]
        return [Touch.single(points[rng.permutation(some)], np.eye(4), 1.0, "patches") for some in near]


@pytest.fixture
def kept(monkeypatch):
    """Let the registration keep as many points of each touch as the list says, and note what it is given."""
    numbers, asked = [SIZE] * 3, []

    def register(touches, cloud, *, pose_error=None):
        asked.append((len(touches), cloud, pose_error))
        found = []
        for touch, count in zip(touches, numbers, strict=True):
            made = dataclasses.replace(touch, points=touch.points[:count] * 0.99, finger=touch.finger[:count])
            zeros = np.zeros(count)
            found.append(RegisteredTouch(made, np.eye(4), np.zeros((6, 6)), zeros, 9, "moved", "it was moved"))
        return Registration(found, np.eye(4), np.zeros((6, 6)), 0.0, 0.0)

    monkeypatch.setattr(pcsr.data.sample, "register", register)
    return numbers, asked


def made(recipe, *overrides, touches=3):
    return make_sample(BALL, Patches(), recipe("points=32", "rate=8", *overrides).data, touches, 0)


def rows(cloud):
    return {tuple(point) for point in np.round(cloud, 5).tolist()}


def test_without_the_key_nothing_is_registered(recipe, kept):
    made(recipe)
    assert kept[1] == []


def test_only_the_touches_differ_from_those_without_registration(recipe, kept):
    plain, one = made(recipe), made(recipe, "registration={position: 0.5, rotation: 3.0}")
    for name in ("truth", "points"):
        assert np.array_equal(getattr(plain, name), getattr(one, name))
    ((count, cloud, error),) = kept[1]
    assert (count, error) == (3, PoseError(0.5, 3.0))
    np.testing.assert_allclose(one.sphere.normalize(cloud), one.points)
    moved = one.sphere.denormalize(plain.touches) * 0.99
    np.testing.assert_allclose(one.sphere.denormalize(one.touches), moved, atol=1e-6)


def test_a_touch_that_lost_points_repeats_the_others(recipe, kept):
    kept[0][1] = 7
    plain, one = made(recipe), made(recipe, "registration={}")
    assert one.touches.shape == (3, SIZE, 3)
    moved = one.sphere.normalize(one.sphere.denormalize(plain.touches) * 0.99)
    for k, count in enumerate([SIZE, 7, SIZE]):
        assert rows(one.touches[k]) == rows(moved[k, :count])
    assert np.array_equal(one.touches, made(recipe, "registration={}").touches)


@pytest.mark.parametrize(("numbers", "usable"), [([0, 5, SIZE], [1, 2]), ([SIZE, 0, 0], [0]), ([0, 0, 0], [])])
def test_a_refused_touch_is_missing_and_covers_nothing(recipe, kept, numbers, usable):
    kept[0][:] = numbers
    plain, one = made(recipe), made(recipe, "registration={}")
    assert one.touches.shape == (len(usable), SIZE, 3)
    for cloud, k in zip(one.touches, usable, strict=True):
        moved = one.sphere.normalize(one.sphere.denormalize(plain.touches[k]) * 0.99)
        assert rows(cloud) == rows(moved[: numbers[k]])
    shares = covered(one.truth, list(one.touches))
    assert one.coverage == shares + (shares[-1] if shares else 0.0,) * (3 - len(usable))


def test_without_touches_there_is_nothing_to_register(recipe, kept):
    one = made(recipe, "registration={}", touches=0)
    assert (one.touches.shape, one.coverage, kept[1]) == ((0, 0, 3), (), [])


def refused(name, count, seed=0):
    """An object of which `count` of two touches were refused."""
    one = sample(name, seed=seed)
    return dataclasses.replace(one, touches=one.touches[: 2 - count])


@pytest.fixture
def folder(tmp_path):
    """A data set whose objects have 2, 1 and 0 usable touches; as if it were registered."""
    write_shard(shard_path(tmp_path, "train", 0), [(f"{k}", refused(f"{k}", k, seed=k)) for k in range(3)], "ab" * 32)
    manifest(tmp_path, [0])
    text = (tmp_path / "manifest.json").read_text()
    (tmp_path / "manifest.json").write_text(text.replace('"view"', '"registration": {"position": 1.0}, "view"'))
    return tmp_path


def test_a_split_has_the_usable_touches_of_each_object(folder):
    split = Split.load(folder, "train")
    assert [touches.shape for touches in split.touches] == [(2, 8, 3), (1, 8, 3), (0, 8, 3)]
    assert all(touches.isfinite().all() for touches in split.touches)
    assert torch.equal(split.touches[1][0], torch.from_numpy(sample("1", seed=1).touches[0]))


def test_without_registration_a_missing_touch_is_damage(folder):
    text = (folder / "manifest.json").read_text()
    (folder / "manifest.json").write_text(text.replace('"registration": {"position": 1.0}', '"registration": null'))
    with pytest.raises(UserError, match="its touches have a coordinate that is not finite"):
        Split.load(folder, "train")


@pytest.mark.parametrize("place", [(0, 1, 3), (0, 0)], ids=["a point", "a touch before others"])
def test_any_other_number_that_is_not_finite_is_damage(folder, place):
    one = sample("0")
    one.touches[place[1:]] = np.nan
    write_shard(shard_path(folder, "train", 0), [("0", one)], "ab" * 32)
    manifest(folder, [0])
    text = (folder / "manifest.json").read_text()
    (folder / "manifest.json").write_text(text.replace('"view"', '"registration": {"position": 1.0}, "view"'))
    with pytest.raises(UserError, match="its touches have a coordinate that is not finite"):
        Split.load(folder, "train")


@pytest.mark.parametrize("patches", [None, PATCHES])
@pytest.mark.parametrize("count", [0, 2, 3])
def test_batches_mask_the_touches_that_an_object_lacks(patches, count):
    whole = split(7)
    numbers = [0, 1, 2, 3, 0, 1, 3]
    fewer = dataclasses.replace(whole, touches=[touches[:k] for touches, k in zip(whole.touches, numbers, strict=True)])
    augment = ("redraw", "rotate", "scale", "jitter")
    batches = Batches(fewer, 7, (count, count), augment, 0, patches)
    for step in range(4):
        touches = batches.at(step).touches
        assert touches.points.shape == (7, count, 8, 3)
        assert touches.points.isfinite().all()
        order = np.random.default_rng((0, step)).permutation(7)
        most = [min(count, numbers[k]) for k in order]
        there = touches.mask.sum(1).tolist()
        assert all(one <= limit for one, limit in zip(there, most, strict=True))
        assert patches or there == most
