"""`digit` with each policy and as a hand: where touches lie, and that fewer are a prefix of more."""

import itertools

import numpy as np
import pytest
import trimesh

from pcsr import UserError
from tests.plugins.touch.touching import SHAPES, touch


@pytest.mark.parametrize("policy", ["uniform", "spread", "sparse", "grasp"])
@pytest.mark.parametrize("noise", [{}, {"depth_noise": 0.1, "drift": 0.1, "rotation_noise": 1.0}])
def test_fewer_touches_are_a_prefix_whatever_the_policy(policy, noise):
    cloud = SHAPES["cylinder"].vertices[::7]
    many, few, more = (touch(SHAPES["cylinder"], count, 5, cloud, policy=policy, **noise) for count in (3, 1, 3))
    assert len(few) == 1
    for a, b in [(many[0], few[0]), *zip(many, more, strict=True)]:
        assert np.array_equal(a.points, b.points)
        assert np.array_equal(a.poses, b.poses)
    assert not np.array_equal(many[1].points, many[2].points)


def nearest(touches):
    """The least distance between the centres of two touches."""
    centres = np.array([touched.points.mean(0) for touched in touches])
    return min(np.linalg.norm(a - b) for i, a in enumerate(centres) for b in centres[:i])


def test_spread_touches_are_farther_apart_than_random_ones():
    for seed in range(3):
        spread = touch(SHAPES["sphere"], 5, seed, policy="spread")
        assert nearest(spread) > 18 > nearest(touch(SHAPES["sphere"], 5, seed))
        first = touch(SHAPES["sphere"], 1, seed)[0]
        assert np.array_equal(spread[0].points, first.points)  # as nothing was touched yet


def test_sparse_touches_go_where_nobody_looked():
    ball = SHAPES["sphere"].copy().apply_scale(0.5).apply_translation([100, 0, 0])
    seen = ball.vertices[ball.vertices[:, 2] < 4.0]
    touched = touch(ball, 3, 0, seen, policy="sparse", object_size=40.0)
    assert all(one.points[:, 2].mean() > 4 for one in touched)
    assert touched[0].points[:, 2].mean() > 8
    bare = touch(ball, 1, 0, np.zeros((0, 3)), policy="sparse", object_size=40.0)[0]
    assert np.array_equal(bare.points, touch(ball, 1, object_size=40.0)[0].points)
    with pytest.raises(UserError, match="part-3: its cloud has a coordinate that is not finite"):
        touch(ball, 1, 0, np.full((1, 3), np.nan), policy="sparse")


def test_a_grasp_is_a_thumb_and_fingers_opposite_to_it():
    bar = trimesh.creation.box((200, 200, 10))
    (touched,) = touch(bar, policy="grasp", tilt=0.0, press=(0.8, 0.8), seed=3)
    assert touched.points.shape == (512, 3)
    assert 2 <= len(touched.poses) <= 4
    assert set(touched.finger) == set(range(len(touched.poses)))
    thumb, *fingers = touched.poses
    assert thumb[2, 2] == pytest.approx(-fingers[0][2, 2])
    for pose, finger in zip(touched.poses, range(4), strict=False):
        inverse = np.linalg.inv(pose)
        local = touched.points[touched.finger == finger] @ inverse[:3, :3].T + inverse[:3, 3]
        np.testing.assert_allclose(local[:, 2], 0.8, atol=1e-6)
    gaps = [np.linalg.norm(a[:3, 3] - b[:3, 3]) for a, b in itertools.pairwise(fingers)]
    np.testing.assert_allclose(gaps, 20.0, atol=1e-6)
    assert touched.contact_area == pytest.approx(len(touched.poses) * 121 * 91 * (16 / 121) ** 2, rel=1e-6)


def test_fingers_too_far_apart_find_only_the_middle_one():
    cube = trimesh.creation.box((40, 40, 40))
    (touched,) = touch(cube, policy="grasp", tilt=0.0, spacing=100.0, at_least_area=1.0)
    assert len(touched.poses) == 2
    # Opposite to each face of an open prism is an edge, where little is touched.
    prism = trimesh.creation.cylinder(radius=40, height=200, sections=3)
    prism.update_faces(np.abs(prism.face_normals[:, 2]) < 0.5)
    assert touch(prism, tilt=0.0, at_least_area=100.0)
    with pytest.raises(UserError, match=r"\d+ with nothing to grasp on the other side"):
        touch(prism, policy="grasp", tilt=0.0, at_least_area=100.0, tries=20)
