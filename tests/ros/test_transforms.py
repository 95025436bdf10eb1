"""Transforms against a naive computation by quaternions, and what is missing or wrong in them."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr import UserError
from pcsr.ros.transforms import Transforms

SECOND = 10**9


def add(transforms, child, parent, time, translation=(0, 0, 0), quaternion=(0, 0, 0, 1)):
    stamp = None if time is None else round(time * SECOND)
    position = SimpleNamespace(**dict(zip("xyz", map(float, translation), strict=True)))
    turned = SimpleNamespace(**dict(zip("xyzw", map(float, quaternion), strict=True)))
    transforms.add(child, parent, stamp, position, turned)


def product(one, other):
    """Of two quaternions x y z w, by Hamilton's rule."""
    a, b = np.asarray(one[:3]), np.asarray(other[:3])
    return np.append(one[3] * b + other[3] * a + np.cross(a, b), one[3] * other[3] - a @ b)


def rotated(quaternion, point):
    conjugate = np.append(-np.asarray(quaternion[:3]), quaternion[3])
    return product(product(quaternion, np.append(point, 0)), conjugate)[:3]


def slerp(one, other, share):
    cosine = one @ other
    one, cosine = (-one, -cosine) if cosine < 0 else (one, cosine)
    angle = np.arccos(min(1.0, cosine))
    if angle < 1e-9:
        return other
    return (np.sin((1 - share) * angle) * one + np.sin(share * angle) * other) / np.sin(angle)


def random_pose(rng):
    quaternion = rng.normal(size=4)
    return rng.normal(size=3), quaternion / np.linalg.norm(quaternion)


@given(st.integers(0, 2**32 - 1))
def test_a_chain_of_moving_frames_is_as_computed_point_by_point(seed):
    rng = np.random.default_rng(seed)
    transforms = Transforms()
    times = [0.0, 0.06, 0.1, 0.19]
    chain = [("tool", "arm"), ("arm", "base"), ("object", "base")]
    poses = {pair: [random_pose(rng) for _ in times] for pair in chain}
    for child, parent in chain:
        for i in rng.permutation(len(times)).tolist():
            add(transforms, child, parent, times[i], *poses[child, parent][i])
    moment = rng.uniform(0, 0.19)
    after = int(np.searchsorted(times, moment))
    share = (moment - times[after - 1]) / (times[after] - times[after - 1])

    def moved(pair, point):
        (here, turned), (there, turned_too) = poses[pair][after - 1], poses[pair][after]
        return (1 - share) * here + share * there + rotated(slerp(turned, turned_too, share), point)

    matrix = transforms.matrix("tool", "object", round(moment * SECOND))
    point = rng.normal(size=3)
    in_base = moved(("arm", "base"), moved(("tool", "arm"), point))
    in_object = matrix @ np.append(point, 1)
    np.testing.assert_allclose(moved(("object", "base"), in_object[:3]), in_base, atol=1e-6)


def test_times_between_at_and_beyond_those_of_transforms():
    transforms = Transforms()
    for time in (10.0, 10.1, 11.0):
        add(transforms, "tool", "base", time, (time, 0, 0))

    def x(time):
        return transforms.matrix("tool", "base", round(time * SECOND))[0, 3]

    assert x(10.0) == 10.0
    assert x(10.025) == pytest.approx(10.025)
    assert x(9.91) == 10.0  # held
    assert x(11.09) == 11.0
    assert x(10.15) == pytest.approx(10.15)  # near one side of the gap
    for time in (9.8, 10.5, 11.11):
        with pytest.raises(
            UserError, match=rf"frame 'tool' has no transform within 0.1 s of {time:.3f} s: the nearest"
        ):
            x(time)
    with pytest.raises(UserError, match=r"all are from 10\.000 to 11\.000 s"):
        x(1e6)
    transforms.max_gap = 1.0
    assert x(10.5) == pytest.approx(10.5)


def test_static_transforms_hold_at_any_time_and_slashes_make_no_difference():
    transforms = Transforms()
    add(transforms, "gel", "tool", None, (0, 0, 0.02), (1, 0, 0, 0))
    add(transforms, "/tool", "/base", 1.0, (1, 0, 0))
    matrix = transforms.matrix("/gel", "base", SECOND)
    np.testing.assert_allclose(matrix @ [0, 0, 0.01, 1], [1, 0, 0.01, 1], atol=1e-12)
    np.testing.assert_allclose(transforms.matrix("base", "gel", SECOND), np.linalg.inv(matrix), atol=1e-12)
    assert transforms.frames == ["base", "gel", "tool"]
    np.testing.assert_array_equal(transforms.matrix("gel", "gel", 5 * SECOND), np.eye(4))


def test_frames_above_the_common_one_need_no_transform_at_that_time():
    transforms = Transforms()
    add(transforms, "map", "earth", 500.0)
    add(transforms, "base", "map", None)
    add(transforms, "tool", "base", 1.0, (1, 0, 0))
    add(transforms, "object", "base", 1.0, (0, 1, 0))
    assert transforms.matrix("tool", "object", SECOND)[:3, 3].tolist() == [1, -1, 0]
    with pytest.raises(UserError, match="frame 'map' has no transform within"):
        transforms.matrix("tool", "earth", SECOND)


def test_of_transforms_of_the_same_time_the_last_holds():
    transforms = Transforms()
    add(transforms, "tool", "base", 1.0, (1, 0, 0))
    add(transforms, "tool", "base", 1.05, (3, 0, 0))
    add(transforms, "tool", "base", 1.0, (2, 0, 0))
    assert transforms.matrix("tool", "base", SECOND)[0, 3] == 2
    assert transforms.matrix("tool", "base", 1_025_000_000)[0, 3] == pytest.approx(2.5)


def test_a_frame_that_gets_another_parent_is_not_interpolated():
    transforms = Transforms()
    add(transforms, "object", "table", 1.0, (1, 0, 0))
    add(transforms, "object", "hand", 1.1, (2, 0, 0))
    add(transforms, "hand", "table", None, (10, 0, 0))
    assert transforms.matrix("object", "table", 1_040_000_000)[0, 3] == 1
    assert transforms.matrix("object", "table", 1_060_000_000)[0, 3] == 12


def test_unknown_frames_and_frames_without_connection():
    transforms = Transforms()
    with pytest.raises(UserError, match="there is no frame 'tool': there are no frames at all"):
        transforms.check("tool", "base")
    add(transforms, "tool", "base", 1.0)
    add(transforms, "camera", "stand", None)
    with pytest.raises(UserError, match="there is no frame 'gel': the frames 'base', 'camera', 'stand', 'tool'"):
        transforms.check("gel", "base")
    with pytest.raises(
        UserError, match="no transform leads from frame 'tool' to 'camera' but to the frames 'base', 'tool'"
    ):
        transforms.check("tool", "camera")
    with pytest.raises(UserError, match="no transform leads"):
        transforms.matrix("tool", "camera", SECOND)
    for number in range(30):
        add(transforms, f"link{number:02}", "base", None)
    with pytest.raises(UserError, match=r"'link17' and 14 more$"):
        transforms.check("gel", "base")


def test_a_circle_of_frames_ends():
    transforms = Transforms()
    add(transforms, "a", "b", None)
    add(transforms, "b", "c", None)
    add(transforms, "c", "b", None)
    add(transforms, "d", "e", None)
    add(transforms, "e", "a", 1.0)
    add(transforms, "e", "f", 9.0)
    with pytest.raises(UserError, match="lead from frame 'b' back to itself"):
        transforms.matrix("a", "f", SECOND)


@pytest.mark.parametrize(
    ("translation", "quaternion", "said"),
    [
        ((np.nan, 0, 0), (0, 0, 0, 1), "the transform from frame 'tool' to 'base' is not finite"),
        ((0, 0, 0), (0, np.inf, 0, 1), "is not finite"),
        ((0, 0, 0), (0, 0, 0, 0), r"quaternion \[0.0, 0.0, 0.0, 0.0\], whose norm is 0, not 1"),
        ((0, 0, 0), (0, 0, 0, 1.01), "whose norm is 1.01, not 1"),
    ],
)
def test_transforms_that_are_no_rigid_motions_are_refused_where_they_are_used(translation, quaternion, said):
    transforms = Transforms()
    for time in (1.0, 1.1, 2.0):
        add(transforms, "tool", "base", time, (1, 0, 0))
    add(transforms, "tool", "base", 1.2, translation, quaternion)
    with pytest.raises(UserError, match=said):
        transforms.matrix("tool", "base", 1_150_000_000)
    assert transforms.matrix("tool", "base", 1_050_000_000)[0, 3] == 1


def test_a_quaternion_of_single_precision_is_a_rotation():
    transforms = Transforms()
    quaternion = np.array([0.1, 0.2, 0.3, 0.5], np.float32)
    quaternion = (quaternion / np.linalg.norm(quaternion)).astype(np.float64) * 1.0005
    add(transforms, "tool", "base", None, (0, 0, 0), quaternion)
    rotation = transforms.matrix("tool", "base", 0)[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
