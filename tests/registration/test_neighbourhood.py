"""What lies around a touch, found with a tree, is what a search of all points finds."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from pcsr import Touch
from pcsr.registration.neighbourhood import AROUND, Neighbourhood, distinct
from tests.registration.patches import by, plate, pressed, rigid, scan, wavy

MOVE = rigid([20, -40, 70], [5, -3, 8])


def of(touch, cloud, margin=5.0):
    return Neighbourhood.of(touch, cKDTree(cloud), cloud.mean(0), margin)


def test_points_around_are_those_of_a_search_of_all():
    touch, cloud = by(pressed(wavy, at=(3, 2)), MOVE), scan(wavy) @ MOVE[:3, :3].T + MOVE[:3, 3]
    one = of(touch, cloud)
    middle = touch.points.mean(0)
    radius = np.linalg.norm(touch.points - middle, axis=1).max() + 5
    near = cloud[np.linalg.norm(cloud - middle, axis=1) <= radius]
    assert len(one.near) == len(near) < AROUND
    back = one.near @ one.axes.T + one.origin + cloud.mean(0)
    assert cdist(back, near).min(1).max() < 1e-9
    np.testing.assert_allclose(one.points @ one.axes.T + one.origin + cloud.mean(0), touch.points, atol=1e-9)
    np.testing.assert_allclose(one.axes, touch.poses[0, :3, :3], atol=1e-12)
    nearest = np.sort(cdist(near, near), axis=1)[:, 1:5].mean(1)
    assert one.spacing == pytest.approx(np.median(nearest))
    assert one.near_spacing == one.spacing


def test_of_a_dense_cloud_some_points_are_looked_at():
    cloud = scan(wavy, count=40_000)
    one = of(pressed(wavy), cloud)
    assert len(one.near) == AROUND
    assert len(np.unique(one.near, axis=0)) == AROUND
    assert one.near_spacing > 2 * one.spacing
    k = np.sort(cdist(one.near, one.near), axis=1)[:, 1:5].mean(1)
    assert one.near_spacing == pytest.approx(np.median(k), rel=0.15)


def test_repeated_points_count_once():
    cloud = scan(wavy)
    once, twice = of(pressed(wavy), cloud), of(pressed(wavy), distinct(np.repeat(cloud, 2, axis=0)))
    np.testing.assert_allclose(once.near, twice.near, atol=1e-9)
    assert once.spacing == pytest.approx(twice.spacing)


def test_points_without_copies_keep_their_order():
    cloud = scan(wavy)
    assert distinct(cloud) is cloud
    np.testing.assert_array_equal(distinct(np.concatenate([cloud, cloud[::-1]])), cloud)


def test_axes_without_a_pose_follow_the_points():
    touch = pressed(wavy)
    one = of(replace(touch, poses=touch.poses[:0]), scan(wavy))
    turned = by(touch, MOVE)
    other = of(replace(turned, poses=turned.poses[:0]), scan(wavy) @ MOVE[:3, :3].T + MOVE[:3, 3])
    np.testing.assert_allclose(other.axes, MOVE[:3, :3] @ one.axes, atol=1e-9)
    assert np.linalg.det(one.axes) == pytest.approx(1)
    assert np.argmin(one.points.std(0)) == 2
    assert not one.surfaces[0].oriented


LINE = np.column_stack([np.linspace(-4, 4, 50), np.zeros(50), np.zeros(50)])


@pytest.mark.parametrize("pose", [np.eye(4), None], ids=["pose", "no pose"])
@pytest.mark.parametrize(
    "points", [LINE, LINE[:, [2, 1, 0]], LINE @ MOVE[:3, :3].T, np.zeros((50, 3)), LINE[:1], plate(np.eye(3)[:, :2])]
)
def test_points_on_a_line_and_few_points_make_no_surface(points, pose):
    one = of(Touch.single(points, pose, 1.0, "digit"), scan(plate))
    assert one.surfaces == ()
    assert one.noise == 0


def test_a_finger_without_a_surface_is_left_out():
    fingers = [pressed(wavy), Touch.single(LINE, np.eye(4), 1.0, "digit"), by(pressed(wavy), MOVE)]
    one = of(Touch.grasp(fingers), scan(wavy))
    assert len(one.surfaces) == 2
    np.testing.assert_allclose(one.axes @ one.surfaces[1].axes, MOVE[:3, :3], atol=1e-9)
