import time
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pcsr.clouds.touch import Touch, covered_area_share
from pcsr.errors import UserError


def square(x, side=10.0, count=512, scale=1.0, seed=0):
    """A touch of a square in the plane z = 0 with its corner at (x, 0), in mm; `scale` units a millimetre."""
    points = np.zeros((count, 3))
    points[:, :2] = np.random.default_rng(seed).uniform(0, side, (count, 2))
    points[:, 0] += x
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", [0.3, 1.0, -2.0]).as_matrix() * scale
    return Touch.single(points * scale, pose, 1 / scale, "square", side**2)


def random_touch(count, pose=None, unit=1.0, sensor="pad", area=None, seed=0):
    return Touch.single(np.random.default_rng(seed).normal(size=(count, 3)), pose, unit, sensor, area)


def test_one_finger_feels_every_point():
    pose = np.diag([2.0, 2, 2, 1])
    touch = random_touch(5, pose, area=3.0)
    assert list(touch.finger) == [0] * 5
    assert np.array_equal(touch.poses, [pose])
    assert random_touch(5).poses.shape == (0, 4, 4)
    assert random_touch(5).contact_area is None
    single = Touch.single(np.ones((2, 3), np.float32), None, 1.0, "pad")
    assert single.points.dtype == np.float64


def test_fingers_keep_their_points_and_poses():
    sizes = {3: "a", 2: "b", 4: "a"}
    fingers = [random_touch(n, np.eye(4) * n, 25.4, name, area=float(n), seed=n) for n, name in sizes.items()]
    grasp = Touch.grasp(fingers)
    assert list(grasp.finger) == [0, 0, 0, 1, 1, 2, 2, 2, 2]
    for index, finger in enumerate(fingers):
        assert np.array_equal(grasp.points[grasp.finger == index], finger.points)
        assert np.array_equal(grasp.poses[index], finger.poses[0])
    assert (grasp.unit, grasp.sensor, grasp.contact_area) == (25.4, "a+b", 9.0)


def test_grasps_join_to_a_larger_grasp():
    pair = Touch.grasp([random_touch(2, np.eye(4), seed=1), random_touch(3, np.eye(4) * 2, seed=2)])
    both = Touch.grasp([random_touch(1, np.eye(4) * 3), pair])
    assert list(both.finger) == [0, 1, 1, 2, 2, 2]
    assert np.array_equal(both.poses[:, 0, 0], [3, 1, 2])


def test_fingers_without_poses_or_areas_stay_apart():
    grasp = Touch.grasp([random_touch(2, area=1.0), random_touch(3)])
    assert list(grasp.finger) == [0, 0, 1, 1, 1]
    assert grasp.poses.shape == (0, 4, 4)
    assert grasp.contact_area is None


@pytest.mark.parametrize(("units", "shown"), [([], r"\[\]"), ([1.0, 1000.0], r"\[1.0, 1000.0\]")])
def test_fingers_in_several_units_are_refused(units, shown):
    with pytest.raises(UserError, match=f"the fingers of a grasp need the same unit, got {shown} mm"):
        Touch.grasp([random_touch(2, unit=unit) for unit in units])


@given(st.integers(1, 40), st.integers(1, 40), st.integers(1, 100))
def test_thinned_draws_each_point_as_often_as_any_other(first, second, count):
    grasp = Touch.grasp([random_touch(first, np.eye(4), seed=1), random_touch(second, np.eye(4), seed=2)])
    thin = grasp.resampled(count, np.random.default_rng(0))
    assert len(thin.points) == len(thin.finger) == count
    at = [np.flatnonzero((grasp.points == point).all(1)).item() for point in thin.points]
    assert np.array_equal(grasp.finger[at], thin.finger)
    times = np.bincount(at, minlength=first + second)
    assert times.max() - times.min() <= 1
    assert np.array_equal(thin.poses, grasp.poses)


def test_thinned_is_random_and_repeatable():
    touch = random_touch(100)
    one, same, other = (touch.resampled(10, np.random.default_rng(seed)).points for seed in (0, 0, 1))
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_a_touch_of_nothing_cannot_be_thinned():
    with pytest.raises(UserError, match="a touch by 'pad' has no points"):
        random_touch(0).resampled(4, np.random.default_rng(0))


@pytest.mark.parametrize("scale", [1.0, 0.001])
@pytest.mark.parametrize(
    ("corners", "union"),
    [([], 0), ([0], 100), ([0, 50], 200), ([0, 5], 150), ([0, 8, 16], 260), ([0, 0], 100)],
)
def test_coverage_is_the_area_of_the_union(corners, union, scale):
    touches = [square(x, scale=scale, seed=index) for index, x in enumerate(corners)]
    # The edge of each overlap is off by about half a millimetre.
    assert covered_area_share(touches, 1000 * scale**2) == pytest.approx(
        union / 1000, abs=0.008 * max(1, len(corners) - 1)
    )


def test_coverage_is_that_of_every_pair_looked_at():
    rng = np.random.default_rng(3)
    touches = [
        replace(
            random_touch(30, unit=2.0, area=rng.uniform(20, 90), seed=n),
            points=rng.normal(size=(30, 3)) + rng.uniform(0, 9, 3),
        )
        for n in range(40)
    ]
    total = 0.0
    for index, touch in enumerate(touches):
        new = np.ones(30, bool)
        for earlier in touches[:index]:
            reach = np.sqrt(4 * earlier.contact_area / (np.pi * 30)) / 2
            distances = np.linalg.norm(touch.points[:, None] - earlier.points, axis=2)
            new &= (distances >= reach).all(1)
        total += touch.contact_area / 4 * new.mean()
    assert total < 0.9 * sum(touch.contact_area / 4 for touch in touches), "some must overlap"
    assert covered_area_share(touches, 5000.0) == pytest.approx(total / 5000, rel=1e-12)


def test_coverage_of_many_touches_does_not_look_at_every_pair():
    touches = [square(index % 50, count=64, seed=index) for index in range(2000)]
    start = time.perf_counter()
    assert 0 < covered_area_share(touches, 1000.0) < 0.6
    assert time.perf_counter() - start < 10, "two million pairs take minutes"


def test_coverage_never_exceeds_the_whole():
    assert covered_area_share([square(0), square(50)], 120.0) == 1.0


def test_coverage_needs_the_area_of_every_touch():
    with pytest.raises(UserError, match="the contact area of touch 1 by 'pad' is not known"):
        covered_area_share([square(0), random_touch(5)], 120.0)


def test_errors_follow_their_points():
    points = np.arange(12.0).reshape(4, 3)
    touch = Touch.single(points, None, 1.0, "digit", errors=np.array([0.1, 0.2, 0.3, 0.4]))
    drawn = touch.resampled(9, np.random.default_rng(0))
    np.testing.assert_allclose(drawn.errors, 0.1 * (1 + drawn.points[:, 0] / 3))
    np.testing.assert_array_equal(touch.subset(np.array([True, False, False, True])).errors, [0.1, 0.4])
    assert Touch.grasp([touch, touch]).errors.shape == (8,)
    assert Touch.grasp([touch, Touch.single(points, None, 1.0, "digit")]).errors is None
