import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pcsr import UserError
from pcsr.geometry.frames import UnitSphere

CLOUD = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 3, 0], [0, -3, 0]])
OFFSET = np.array([5.0, 6, 7])


def test_the_frame_is_centred_and_its_farthest_point_is_on_the_unit_sphere():
    sphere = UnitSphere.fit(CLOUD + OFFSET)
    assert sphere.centre == pytest.approx(OFFSET)
    assert sphere.radius == pytest.approx(3)
    assert np.allclose(sphere.normalize(CLOUD + OFFSET), CLOUD / 3)


def test_inside_is_float32_and_back_is_float64():
    sphere = UnitSphere.fit(CLOUD.astype(np.float32))
    assert sphere.normalize(CLOUD).dtype == np.float32
    assert sphere.denormalize(sphere.normalize(CLOUD)).dtype == np.float64


@given(
    arrays(np.float64, (6, 3), elements=st.floats(-1, 1, width=32)),
    st.floats(-1e6, 1e6),
    st.floats(1e-3, 1e3),
)
def test_undo_undoes_apply(points, offset, scale):
    points[0], points[1] = -1, 1
    cloud = points * scale + offset
    sphere = UnitSphere.fit(cloud)
    assert np.abs(sphere.denormalize(sphere.normalize(cloud)) - cloud).max() < 1e-6 * scale + 1e-9


def test_millimetres_survive_coordinates_of_millions():
    inside = UnitSphere.fit(CLOUD * 1e-3 + 4e6).normalize(CLOUD * 1e-3 + 4e6)
    assert np.abs(inside - CLOUD / 3).max() < 1e-6


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.zeros((0, 3)), "no points"),
        (np.full((5, 3), 0.1), "all 5 points of the cloud lie on one spot"),
        (np.array([[0, 0, 0], [np.nan, 0, 0], [0, np.inf, 1]]), "2 of 3 points"),
    ],
)
def test_a_cloud_without_a_frame_is_refused(points, message):
    with pytest.raises(UserError, match=message):
        UnitSphere.fit(points)
