"""Mistakes in what a registration is given are one line that names thing, value and remedy."""

import copy

import jaxtyping
import numpy as np
import pytest
import torch

from pcsr import PoseError, UserError, load, register
from tests.registration import by_hand

CLOUD = by_hand.scan(400)
TOUCH = by_hand.touches()[0]


def altered(**changes):
    """The touch with other attributes, of any type: a caller's types are not checked."""
    touch = copy.copy(TOUCH)
    for name, value in changes.items():
        object.__setattr__(touch, name, value)
    return touch


@pytest.fixture(autouse=True)
def untyped():
    """A caller's types are not checked, unlike those in the tests of pcsr itself."""
    before = jaxtyping.config.jaxtyping_disable
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", before)


pytestmark = pytest.mark.filterwarnings("error")


@pytest.mark.parametrize("convert", [np.ndarray.tolist, torch.tensor, np.ndarray.copy])
def test_clouds_of_all_kinds_are_registered_alike(convert):
    expected, found = register([TOUCH], CLOUD), register(iter([TOUCH]), convert(CLOUD))
    np.testing.assert_array_equal(expected.touches[0].motion, found.touches[0].motion)
    assert expected.touches[0].reason == found.touches[0].reason


@pytest.mark.parametrize(
    ("cloud", "said"),
    [
        ([], r"shape \(n, 3\), got \(0,\)"),
        (CLOUD[:, :2], r"shape \(n, 3\), got \(400, 2\)"),
        ("scan.ply", "a str is no cloud: give an array"),
        (None, "a NoneType is no cloud"),
        (np.full((3, 3), np.nan), "not finite: remove them"),
        (CLOUD * 1e300, "mm across at a unit of 1 mm: correct the touches' unit"),
        (CLOUD * 1e-300, "mm across at a unit of 1 mm: correct the touches' unit"),
    ],
)
def test_no_cloud(cloud, said):
    with pytest.raises(UserError, match=said) as error:
        register([TOUCH], cloud)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("touches", "said"),
    [
        (TOUCH, r"a Touch is no list of touches: give a list of pcsr\.Touch records"),
        ("touches/", "a str is no list of touches"),
        (None, "a NoneType is no list of touches"),
        ([TOUCH.points], r"touch 0 is a ndarray: give a list of pcsr\.Touch records"),
        ([TOUCH, altered(unit=1000.0)], r"need the same unit, got \[1.0, 1000.0\] mm"),
        ([TOUCH, altered(points=TOUCH.points[:0], finger=TOUCH.finger[:0])], "touch 1 has 0 points"),
        ([altered(points=torch.tensor(TOUCH.points))], "touch 0: points are a Tensor"),
        ([altered(points=TOUCH.points * 1e300)], r"touch 0 is .* mm across at a unit of 1 mm: correct its unit"),
        ([altered(points=TOUCH.points + 1e300)], "touch 0 is 1e\\+300 mm from the cloud's centroid"),
        ([altered(unit=1e5)], r"touch 0 is .* mm across at a unit of 100000 mm: correct its unit"),
        ([altered(unit="mm")], "touch 0: unit is 'mm': it must be"),
        ([altered(unit=0.0)], r"touch 0: unit is 0\.0: it must be"),
        ([altered(unit=np.nan)], "touch 0: unit is nan: it must be"),
        ([altered(view=(np.nan, 1.0))], "touch 0: view is .*: it must be two sides in mm"),
        ([altered(view=(1.0,))], "touch 0: view is .*: it must be two sides in mm"),
        ([altered(poses=np.full((1, 4, 4), np.nan))], "touch 0: a pose is no 4x4 matrix"),
        ([altered(poses=np.zeros((1, 4, 4)))], "touch 0: a pose is no 4x4 matrix"),
    ],
)
def test_no_touches(touches, said):
    with pytest.raises(UserError, match=said) as error:
        register(touches, CLOUD)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("error", [(1, 2), {"position": 1, "rotation": 2}, "1,2"])
def test_no_pose_error(error):
    with pytest.raises(UserError, match=r"give a pcsr\.PoseError\(position=…, rotation=…\)"):
        register([TOUCH], CLOUD, pose_error=error)


@pytest.mark.parametrize("value", ["a", None, [1], np.array([1, 2]), 1j, True])
def test_no_number_in_a_pose_error(value):
    with pytest.raises(UserError, match=r"pose error: rotation is .*: it must be a number of degrees, 0 to 45"):
        PoseError(1.0, value)


@pytest.mark.parametrize("touches", [TOUCH, None])
def test_no_touches_of_a_model(touches):
    with pytest.raises(UserError, match="give a list of touches, or the folder of a recording"):
        load("midpoint").upsample(CLOUD, touches)
