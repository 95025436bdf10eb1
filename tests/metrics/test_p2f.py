import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from pcsr import RunError, UserError
from pcsr.geometry.sampling import surface_points
from pcsr.metrics import p2f, point_to_surface


def naive(points, vertices, faces):
    """Trimesh's closest point on each triangle, every pair of them."""
    triangles = np.asarray(vertices)[faces]
    rows = []
    for point in points:
        at = trimesh.triangles.closest_point(triangles, np.tile(point, (len(triangles), 1)))
        rows.append(np.linalg.norm(at - point, axis=1).min())
    return np.array(rows)


def box_distance(points, half):
    """Distance to the surface of an axis-aligned box, in closed form."""
    outside = np.abs(points) - half
    return np.where((outside > 0).any(1), np.linalg.norm(np.maximum(outside, 0), axis=1), np.abs(outside.max(1)))


@given(st.integers(0, 999))
@settings(max_examples=40, deadline=None)
def test_the_distance_agrees_with_trimesh_on_triangles_of_every_shape(seed):
    rng = np.random.default_rng(seed)
    vertices = rng.normal(size=(20, 3)) * rng.choice([1, 1e-3], (20, 1))
    faces = np.array([rng.choice(20, 3, replace=False) for _ in range(12)])
    points = rng.normal(size=(30, 3))
    assert np.allclose(point_to_surface(points, vertices, faces), naive(points, vertices, faces), atol=1e-12)


@pytest.mark.parametrize(("block", "pairs"), [(2048, 1 << 18), (7, 1 << 18), (2048, 1), (100, 500)])
def test_the_distance_to_a_box_is_exact_inside_and_outside(block, pairs, monkeypatch):
    monkeypatch.setattr(p2f, "BLOCK", block)
    monkeypatch.setattr(p2f, "PAIRS", pairs)
    box = trimesh.creation.box((2, 4, 6))
    points = np.random.default_rng(0).normal(size=(300, 3)) * 3
    expected = box_distance(points, np.array([1, 2, 3]))
    assert np.allclose(point_to_surface(points, box.vertices, box.faces), expected, atol=1e-12)


def test_long_triangles_are_cut_without_changing_the_answer():
    rod = trimesh.creation.cylinder(0.1, 40, sections=24)
    points = surface_points(rod, 400, np.random.default_rng(0)) + 0.05
    assert len(p2f._cut(np.asarray(rod.triangles), 400)) > 3 * len(rod.faces)
    assert np.allclose(point_to_surface(points, rod.vertices, rod.faces), naive(points, rod.vertices, rod.faces))


def test_points_of_the_surface_are_at_no_distance():
    ball = trimesh.creation.icosphere(3)
    points = surface_points(ball, 500, np.random.default_rng(0))
    assert point_to_surface(points, ball.vertices, ball.faces).max() < 1e-12


def test_a_clump_amid_the_mesh_where_every_triangle_is_a_candidate():
    ball = trimesh.creation.icosphere(2)
    points = np.random.default_rng(0).normal(size=(40, 3)) * 1e-3
    expected = naive(points, ball.vertices, ball.faces)
    assert np.allclose(point_to_surface(points, ball.vertices, ball.faces), expected, atol=1e-12)


def test_the_distance_is_in_the_unit_of_the_mesh():
    ball = trimesh.creation.icosphere(2)
    points = np.random.default_rng(0).normal(size=(50, 3))
    metres = point_to_surface(points, ball.vertices, ball.faces)
    assert np.allclose(point_to_surface(points * 1000, ball.vertices * 1000, ball.faces), 1000 * metres)


def test_triangles_without_area_count_as_their_edges():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [5, 5, 5]])
    faces = np.array([[0, 1, 2], [3, 3, 3]])
    points = np.array([[1.5, 2, 0], [-3, 4, 0], [5, 5, 6]])
    assert point_to_surface(points, vertices, faces).tolist() == [2, 5, 1]


def test_a_sliver_is_measured_to_its_plane():
    thin = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 1e-7, 0]])
    points = np.array([[0.5, 3e-8, 0.25], [0.5, 3e-8, 1e-9]])
    assert point_to_surface(points, thin, np.array([[0, 1, 2]])) == pytest.approx([0.25, 1e-9], rel=1e-5)


def test_a_mesh_without_faces_is_refused():
    with pytest.raises(UserError, match="no faces"):
        point_to_surface(np.zeros((1, 3)), np.zeros((0, 3)), np.zeros((0, 3), int))


def test_points_that_are_not_finite_are_said():
    box = trimesh.creation.box()
    with pytest.raises(RunError, match="not finite"):
        point_to_surface(np.full((1, 3), np.nan), box.vertices, box.faces)
