import numpy as np
import pytest
import trimesh

from pcsr import UserError
from pcsr_plugins.touch.rays import MeshRays


def highest(triangles, place, axis):
    """The highest crossing of a line with any triangle, by solving for barycentric coordinates one by one."""
    heights = [-np.inf]
    for a, b, c in triangles:
        matrix = np.column_stack([b - a, c - a, -axis])
        if abs(np.linalg.det(matrix)) < 1e-12:
            continue
        u, v, height = np.linalg.solve(matrix, place - a)
        if u >= 0 and v >= 0 and u + v <= 1:
            heights.append(height)
    return max(heights)


def test_heights_agree_with_solving_every_triangle():
    rng = np.random.default_rng(0)
    mesh = trimesh.Trimesh(rng.normal(size=(45, 3)), np.arange(45).reshape(15, 3), process=False)
    rays = MeshRays(mesh, None, "triangles")
    centre = mesh.bounds.mean(0)
    places = rng.uniform(-1, 1, (200, 3))
    axes = rng.normal(size=(200, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    slow = [highest(mesh.triangles - centre, *line) for line in zip(places, axes, strict=True)]
    assert np.isfinite(slow).sum() > 50
    assert np.isneginf(slow).sum() > 10
    np.testing.assert_allclose(rays.heights(places, axes), slow, atol=1e-6)


def test_a_wall_seen_edge_on_gives_no_point_off_the_mesh():
    rays = MeshRays(trimesh.creation.box((10, 10, 10)), None, "box")
    rng = np.random.default_rng(0)
    grazing = 10 ** rng.uniform(-9, -3, 20_000)
    axes = np.column_stack([grazing, np.zeros(20_000), np.ones(20_000)])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    beside = rng.normal(size=20_000) * 10 ** rng.uniform(-8, -4, 20_000)
    places = np.column_stack([5 + beside, rng.uniform(-5, 5, (20_000, 2))])
    heights = rays.heights(places, axes)
    met = np.isfinite(heights)
    assert met.sum() > 10_000
    points = places[met] + axes[met] * heights[met, None]
    assert np.abs(np.abs(points).max(1) - 5).max() < 1e-5


def test_places_are_uniform_by_area_on_the_surface():
    mesh = trimesh.creation.box((1, 2, 4)).subdivide_loop(1)  # triangles of many sizes
    places, normals = MeshRays(mesh, None, "box").places(20_000, np.random.default_rng(0))
    _, distance, face = trimesh.proximity.closest_point_naive(mesh, places[:300] + mesh.bounds.mean(0))
    assert distance.max() < 1e-9
    assert np.abs(np.einsum("ij,ij->i", normals[:300], mesh.face_normals[face])).min() > 0.99
    halves = (mesh.triangles_center - mesh.bounds.mean(0))[:, 2] > 0
    assert np.mean(places[:, 2] > 0) == pytest.approx(mesh.area_faces[halves].sum() / mesh.area, abs=0.02)


def test_to_object_undoes_size_and_centre():
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.02)
    mesh.apply_translation([100, -50, 3])
    rays = MeshRays(mesh, 60.0, "ball")
    assert rays.size == pytest.approx(60)
    places, _ = rays.places(50, np.random.default_rng(0))
    back = places @ rays.to_object[:3, :3].T + rays.to_object[:3, 3]
    radius = np.linalg.norm(back - [100, -50, 3], axis=1)
    assert ((radius > 0.019) & (radius < 0.02 + 1e-9)).all()


@pytest.mark.parametrize(
    ("vertices", "faces", "reason"),
    [
        (np.zeros((0, 3)), np.zeros((0, 3), int), "no faces"),
        (np.eye(3)[[0, 1, 1]], [[0, 1, 2]], "no area"),
        (np.ones((3, 3)), [[0, 1, 2]], "no area"),
        ([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]], [[0, 1, 2]], "not finite"),
    ],
)
def test_a_mesh_without_surface_is_named(vertices, faces, reason):
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    with pytest.raises(UserError, match=f"^shelf-7: the mesh has .*{reason}"):
        MeshRays(mesh, 60.0, "shelf-7")
