import numpy as np
import pytest
import trimesh

from pcsr.geometry.rays import MeshRays
from pcsr_plugins.touch.digit import sensors
from pcsr_plugins.touch.digit.press import Finger
from pcsr_plugins.touch.digit.visible_pixels import promising

SENSOR = sensors.load("digit", pixels=61)
GEL = Finger(SENSOR).gel
TORUS = MeshRays(trimesh.creation.torus(20, 6), None, "torus")


def test_no_pixel_that_sees_something_is_missing_and_nothing_is_above_the_bound():
    rng = np.random.default_rng(0)
    left_out = 0
    for place in rng.uniform(-20, 20, (30, 3)):
        frame, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        heights = TORUS.heights(place + GEL @ frame[:, :2].T, np.broadcast_to(frame[:, 2], (len(GEL), 3)))
        lowest = float(rng.uniform(-10, 10))
        bound, pixels = promising(SENSOR, TORUS, place, frame, lowest)
        assert heights.max() <= bound
        assert pixels[heights > lowest].all()
        left_out += (~pixels).sum()
    assert left_out > 5000


@pytest.mark.parametrize("across", [0.0, 5.0])
def test_a_triangle_counts_with_its_box_and_no_further(across):
    triangle = [[0, 0, 0], [4, 0, 0], [0, 3, 2]]
    rays = MeshRays(trimesh.Trimesh(triangle, [[0, 1, 2]], process=False), None, "wedge")  # centred: z from -1 to 1
    bound, pixels = promising(SENSOR, rays, np.array([across, 0, 0.25]), np.eye(3), 0.5)
    assert bound == pytest.approx(0.75, abs=1e-3)
    x, y = GEL.T + np.array([[across], [0.0]])
    assert np.array_equal(pixels, (np.abs(x) <= 2) & (np.abs(y) <= 1.5))
    assert not promising(SENSOR, rays, np.array([across, 0, 0.25]), np.eye(3), 0.8)[1].any()
    assert promising(SENSOR, rays, np.array([30.0, 0, 0]), np.eye(3), 0.0)[0] < -1e9


def test_a_mesh_of_more_faces_than_pixels_is_not_looked_at():
    few = sensors.load("digit", pixels=10)
    bound, pixels = promising(few, TORUS, np.zeros(3), np.eye(3), 0.0)
    assert bound == np.inf
    assert pixels.all()
