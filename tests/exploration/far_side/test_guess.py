import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import KDTree

from pcsr.data.view import seen_points
from pcsr.exploration.far_side import far_side
from pcsr.exploration.far_side.network import FarSideNetwork, fitted_network
from pcsr.recipe import View
from tests.exploration.scenes import NOTHING, ball

UP = np.array([0.0, 0, 1])
HALF = ball(1200)[ball(1200)[:, 2] > 0]


def test_half_a_ball_is_closed():
    found = far_side(HALF, NOTHING, UP)
    assert len(found.points) > 200
    assert (found.points[:, 2] < 3).all()
    inner = np.linalg.norm(found.points[:, :2], axis=1) < 8
    assert (found.points[inner, 2] < -3).all()
    assert (found.normals[:, 2] < 0).all()
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1, atol=1e-9)
    flat = np.pi * 15**2
    assert 0.5 * flat < found.areas.sum() < 3 * flat
    assert (found.errors > 0).all()


def test_the_guess_grows_and_moves_with_the_cloud():
    found, other = far_side(HALF, NOTHING, UP), far_side(1000 * HALF + 5e4, NOTHING, UP)
    np.testing.assert_allclose(other.points, 1000 * found.points + 5e4, rtol=1e-3)
    np.testing.assert_allclose(other.areas, 1e6 * found.areas, rtol=1e-2)


@pytest.mark.parametrize("depth", [-6.0, -22.0])
def test_the_guess_goes_through_touched_points(depth):
    x, y = np.meshgrid(np.linspace(-4, 4, 9), np.linspace(-4, 4, 9))
    touched = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, depth)])
    off = []
    for known in (NOTHING, touched):
        points = far_side(HALF, known, UP).points
        below = KDTree(points[:, :2]).query(touched[:, :2])[1]
        off.append(np.abs(points[below, 2] - depth).mean())
    assert off[1] < 0.5 * off[0]


def test_the_far_side_of_a_box_is_near_its_surface_and_far_from_the_cloud():
    box = trimesh.creation.box((30, 20, 15))
    rng = np.random.default_rng(5)
    seen = seen_points(box, 600, View(distance=20.0), rng, "box")
    direction = seen.mean(0) / np.linalg.norm(seen.mean(0))
    found = far_side(seen, NOTHING, direction)
    truth = box.sample(20_000, seed=0)
    off = KDTree(truth).query(found.points)[0]
    assert np.median(off) < 3
    assert np.median(KDTree(seen).query(found.points)[0]) > 4


def test_the_network_gives_three_layers():
    network = FarSideNetwork()
    layers = network(torch.zeros(2, 4, 32, 32))
    assert [layer.shape for layer in layers] == [torch.Size([2, 32, 32])] * 3
    assert fitted_network() is fitted_network()
