"""The loop in simulation: poses of `next_touches`, touched on a mesh."""

from typing import ClassVar

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from pcsr import Policy, ShapeItem, Touch, TouchSource, UserError
from pcsr.data.view import seen_points
from pcsr.exploration.loop import explore
from pcsr.metrics.p2f import point_to_surface
from pcsr.recipe import View
from pcsr_plugins.policies.expected_error import ExpectedError
from pcsr_plugins.policies.sparse import Sparse
from pcsr_plugins.touch.digit import Digit

BOX = ShapeItem("box", "boxes", trimesh.creation.box((0.03, 0.02, 0.015)))
"""A box in metres."""
SOURCE = Digit(object_size=30.0, points=64)


@pytest.fixture(scope="module")
def seen():
    return seen_points(BOX.mesh, 400, View(), np.random.default_rng(1), "box")


@pytest.fixture(scope="module")
def found(seen):
    return explore(BOX, SOURCE, seen, ExpectedError(), 3)


def test_the_finger_touches_the_object(found, seen):
    assert len(found.touches) == len(found.chosen) == len(found.errors) == 3
    assert found.unit == pytest.approx(1000)
    for touch in found.touches:
        assert touch.unit == found.unit
        assert point_to_surface(touch.points, BOX.mesh.vertices, BOX.mesh.faces).max() < 1e-4  # in metres
    every = np.concatenate([touch.points for touch in found.touches])
    assert KDTree(seen).query(every)[0].max() > 0.008  # one touch at least is on the hidden side


def test_gains_are_parts_of_the_expected_error(found):
    for touch, error in zip(found.chosen, found.errors, strict=True):
        assert 0 < touch.gain < error


def test_the_same_seed_gives_the_same_touches(found, seen):
    again = explore(BOX, SOURCE, seen, ExpectedError(), 2)
    for one, other in zip(found.touches, again.touches, strict=False):
        np.testing.assert_array_equal(KDTree(one.points).query(other.points)[0] < 1e-2, True)


def test_policies_know_the_cloud_and_the_touches_alone(seen):
    class Watching(Policy):
        candidates: ClassVar[list] = []

        def scores(self, candidates, cloud, touched):
            self.candidates.append((candidates.points, cloud, touched))
            return np.zeros(len(candidates))

    explore(BOX, SOURCE, seen, Watching(), 2)
    true = seen * 1000
    first, cloud, touched = Watching.candidates[0]
    np.testing.assert_allclose(np.sort(cloud - cloud.mean(0), 0), np.sort(true - true.mean(0), 0), atol=1e-6)
    assert len(touched) == 0
    moved = first + true.mean(0) - cloud.mean(0)
    guessed = moved[KDTree(true).query(moved)[0] > 1e-6]
    assert 0 < len(guessed) < len(moved)
    assert point_to_surface(guessed / 1000, BOX.mesh.vertices, BOX.mesh.faces).min() > 1e-7  # not on the mesh
    assert len(Watching.candidates[-1][2]) > 0


def test_a_finger_that_fails_is_counted(seen):
    class Blocked(Digit):
        def finger(self, item):
            finger = super().finger(item)
            finger.touch = lambda pose, rng: None
            return finger

    found = explore(BOX, Blocked(object_size=30.0), seen, Sparse(), 3)
    assert found.touches == ()
    assert found.failed > 1


def test_a_source_without_a_finger_is_named(seen):
    class Corner(TouchSource):
        def touches(self, item, cloud, count, seed):
            return [Touch.single(np.zeros((1, 3)), None, unit=1.0, sensor="point")] * count

    with pytest.raises(UserError, match="Corner cannot touch at given poses"):
        explore(BOX, Corner(), seen, Sparse(), 1)
