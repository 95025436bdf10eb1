import numpy as np
import pytest
import trimesh

from pcsr.errors import UserError
from pcsr.geometry.rays import MeshRays


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
    positions = rng.uniform(-1, 1, (200, 3))
    axes = rng.normal(size=(200, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    slow = [highest(mesh.triangles - centre, *line) for line in zip(positions, axes, strict=True)]
    assert np.isfinite(slow).sum() > 50
    assert np.isneginf(slow).sum() > 10
    np.testing.assert_allclose(rays.heights(positions, axes), slow, atol=1e-6)


def test_a_wall_seen_edge_on_gives_no_point_off_the_mesh():
    rays = MeshRays(trimesh.creation.box((10, 10, 10)), None, "box")
    rng = np.random.default_rng(0)
    grazing = 10 ** rng.uniform(-9, -3, 20_000)
    axes = np.column_stack([grazing, np.zeros(20_000), np.ones(20_000)])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    beside = rng.normal(size=20_000) * 10 ** rng.uniform(-8, -4, 20_000)
    positions = np.column_stack([5 + beside, rng.uniform(-5, 5, (20_000, 2))])
    heights = rays.heights(positions, axes)
    met = np.isfinite(heights)
    assert met.sum() > 10_000
    points = positions[met] + axes[met] * heights[met, None]
    assert np.abs(np.abs(points).max(1) - 5).max() < 1e-5


def test_places_are_uniform_by_area_on_the_surface():
    mesh = trimesh.creation.box((1, 2, 4)).subdivide_loop(1)  # triangles of many sizes
    positions, normals = MeshRays(mesh, None, "box").surface_points(20_000, np.random.default_rng(0))
    _, distance, face = trimesh.proximity.closest_point_naive(mesh, positions[:300] + mesh.bounds.mean(0))
    assert distance.max() < 1e-9
    assert np.abs(np.einsum("ij,ij->i", normals[:300], mesh.face_normals[face])).min() > 0.99
    halves = (mesh.triangles_center - mesh.bounds.mean(0))[:, 2] > 0
    assert np.mean(positions[:, 2] > 0) == pytest.approx(mesh.area_faces[halves].sum() / mesh.area, abs=0.02)


def test_to_object_undoes_size_and_centre():
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=0.02)
    mesh.apply_translation([100, -50, 3])
    rays = MeshRays(mesh, 60.0, "ball")
    assert rays.size == pytest.approx(60)
    positions, _ = rays.surface_points(50, np.random.default_rng(0))
    back = positions @ rays.to_object[:3, :3].T + rays.to_object[:3, 3]
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


def slow_depth(triangles, start, direction):
    """The first crossing of a ray with any triangle, in multiples of its direction, one triangle at a time."""
    depths = [np.inf]
    for a, b, c in triangles:
        matrix = np.column_stack([b - a, c - a, -direction])
        if abs(np.linalg.det(matrix)) < 1e-12:
            continue
        u, v, depth = np.linalg.solve(matrix, start - a)
        if u >= 0 and v >= 0 and u + v <= 1 and depth >= 0:
            depths.append(depth)
    return min(depths)


def test_depths_agree_with_solving_every_triangle_from_inside_and_outside():
    rng = np.random.default_rng(1)
    mesh = trimesh.Trimesh(rng.normal(size=(45, 3)), np.arange(45).reshape(15, 3), process=False)
    rays = MeshRays(mesh, None, "triangles")
    starts = rng.uniform(-1, 1, (200, 3))
    directions = rng.normal(size=(200, 3)) * 10 ** rng.uniform(-1, 1, (200, 1))
    slow = [slow_depth(mesh.triangles - mesh.bounds.mean(0), *ray) for ray in zip(starts, directions, strict=True)]
    assert np.isfinite(slow).sum() > 30
    assert np.isinf(slow).sum() > 30
    found = rays.depths(starts, directions)
    assert np.array_equal(np.isfinite(found), np.isfinite(slow))
    np.testing.assert_allclose(found, slow, rtol=1e-5, atol=1e-6)


def test_depths_are_multiples_of_the_direction():
    rays = MeshRays(trimesh.creation.box((10, 10, 10)), None, "box")
    starts = np.full((3, 3), [0.0, 0, 25])
    directions = np.array([[0, 0, -1.0], [0.04, 0, -2], [0, 0, 4]])
    np.testing.assert_allclose(rays.depths(starts, directions), [20, 10, np.inf])
    assert len(rays.depths(starts[:0], directions[:0])) == 0


def test_boxes_hold_their_triangles_and_touch_them():
    rng = np.random.default_rng(0)
    mesh = trimesh.creation.torus(20, 6)
    rays = MeshRays(mesh, 50.0, "torus")
    place, frame = rng.uniform(-20, 20, 3), np.linalg.qr(rng.normal(size=(3, 3)))[0]
    low, high = rays.boxes(place, frame)
    assert rays.faces == len(mesh.faces) == len(low)
    corners = (mesh.triangles - mesh.bounds.mean(0)) * 50 / mesh.extents.max()
    along = np.array([[frame.T @ (corner - place) for corner in triangle] for triangle in corners[:100]])
    np.testing.assert_allclose(low[:100], along.min(1), atol=1e-9)
    np.testing.assert_allclose(high[:100], along.max(1), atol=1e-9)


def test_vertices_of_no_face_and_the_unit_are_no_trouble():
    box = trimesh.creation.box((2, 2, 2))
    mesh = trimesh.Trimesh([*box.vertices, [np.nan, np.inf, 1e9]], box.faces, process=False)
    rays = MeshRays(mesh, 60.0, "box")
    assert rays.unit == pytest.approx(30)
    np.testing.assert_allclose(rays.to_object, np.diag([1 / 30, 1 / 30, 1 / 30, 1]))
    np.testing.assert_allclose(rays.heights(np.zeros((1, 3)), np.array([[0, 0, 1.0]])), [30.0])
