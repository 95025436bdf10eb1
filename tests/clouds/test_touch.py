import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pcsr.clouds.touch import Touch, coverage


def square(x, side=10.0, count=512, scale=1.0, seed=0):
    """A touch of a square in the plane z = 0 with its corner at (x, 0), in mm; `scale` units a millimetre."""
    points = np.zeros((count, 3))
    points[:, :2] = np.random.default_rng(seed).uniform(0, side, (count, 2))
    points[:, 0] += x
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", [0.3, 1.0, -2.0]).as_matrix() * scale
    return Touch(points * scale, pose, "square", side**2)


def test_scale_is_read_off_the_pose():
    assert square(0, scale=0.02).scale == pytest.approx(0.02)


@pytest.mark.parametrize("scale", [1.0, 0.001])
@pytest.mark.parametrize(
    ("corners", "union"),
    [([], 0), ([0], 100), ([0, 50], 200), ([0, 5], 150), ([0, 8, 16], 260), ([0, 0], 100)],
)
def test_coverage_is_the_area_of_the_union(corners, union, scale):
    touches = [square(x, scale=scale, seed=index) for index, x in enumerate(corners)]
    # The edge of each overlap is off by about half a millimetre.
    assert coverage(touches, 1000 * scale**2) == pytest.approx(union / 1000, abs=0.008 * max(1, len(corners) - 1))


def test_coverage_never_exceeds_the_whole():
    assert coverage([square(0), square(50)], 120.0) == 1.0
