import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from pcsr_plugins.shapes.blobs import isosurface
from pcsr_plugins.shapes.blobs.isosurface import SHEETS, TRIANGLES, solid_of, surface_net
from pcsr_plugins.shapes.blobs.sdf import dented, ellipsoid, joined, limb, ring


def mesh_of(field):
    surface = solid_of(field).to_mesh64()
    return trimesh.Trimesh(surface.vert_properties[:, :3], surface.tri_verts.astype(np.int64), process=False)


@pytest.mark.parametrize("radius", [12, 30, 80])
def test_a_ball_is_a_ball_of_about_as_many_triangles_whatever_its_size(radius):
    mesh = mesh_of(ellipsoid((3, 2, 1), 3 * [radius]))
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(4 / 3 * np.pi * radius**3, rel=2e-3)
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices - (3, 2, 1), axis=1), radius, rtol=1e-5)
    assert 0.8 * TRIANGLES < len(mesh.faces) < 1.25 * TRIANGLES


@pytest.mark.parametrize(
    ("field", "pieces", "holes"),
    [
        (ring((0, 0, 0), 30, 6), 1, 1),
        (joined(4, ring((-22, 0, 0), 20, 5), ring((22, 0, 0), 20, 5)), 1, 2),
        (joined(0.1, ellipsoid((-21.5, 0, 0), (20, 20, 20)), ellipsoid((21.5, 0, 0), (20, 20, 20))), 2, 0),
        (limb([(-60, 0, 0), (60, 0, 0)], [7, 1]), 1, 0),
        (dented(0.1, ellipsoid((0, 0, 0), (30, 30, 30)), limb([(0, 0, -40), (0, 0, 40)], [3, 3])), 1, 1),
    ],
)
def test_pieces_and_holes_are_kept(field, pieces, holes):
    solid = solid_of(field)
    assert len(solid.decompose()) == pieces
    assert sum(piece.genus() for piece in solid.decompose()) == holes


def test_without_a_body_there_is_none():
    assert solid_of(lambda at: np.ones(len(at))).is_empty()


def test_triangles_are_well_shaped():
    corners = mesh_of(limb([(-40, 0, 0), (0, 20, 0), (40, 0, 5)], [14, 9, 5])).triangles
    sides = np.linalg.norm(np.roll(corners, 1, axis=1) - corners, axis=2)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    quality = 4 * np.sqrt(3) * areas / (sides**2).sum(axis=1)
    assert np.percentile(quality, 1) > 0.6


def test_only_places_near_the_surface_are_asked_for():
    asked = []
    field = ellipsoid((0, 0, 0), (60, 60, 60))
    vertices = len(mesh_of(lambda at: asked.append(len(at)) or field(at)).vertices)
    assert sum(asked) < 25 * vertices  # the whole grid has 60 for each


def test_refining_finds_each_sign_that_the_whole_grid_has():
    field = joined(3, limb([(-30, 0, 0), (5, 18, 0), (30, 0, 9)], [7, 4, 6]), ring((0, -10, 0), 15, 3))
    step, low = 4.0, np.full(3, -48.0)
    counts = 3 * (25,)
    coarse = field(low + step * np.indices(counts).reshape(3, -1).T).reshape(counts)
    fine, start = isosurface._refined(field, coarse, low, step)
    whole = field(start + step / 2 * np.indices(fine.shape).reshape(3, -1).T).reshape(fine.shape)
    np.testing.assert_array_equal(fine < 0, whole < 0)
    crossed = np.diff(whole < 0, axis=0)
    assert crossed.any()
    np.testing.assert_array_equal(fine[:-1][crossed], whole[:-1][crossed])


@given(st.integers(0, 2**32), st.integers(2, 6), st.floats(0.1, 0.9))
def test_a_net_of_noise_is_closed_and_faces_outwards(seed, side, filled):
    values = np.random.default_rng(seed).uniform(size=3 * (side,)) - filled
    values = np.pad(values, 1, constant_values=1.0)
    if not (values < 0).any():
        return
    vertices, faces = surface_net(values)
    assert len(faces) == 2 * sum(np.diff(values < 0, axis=a).sum() for a in range(3))
    assert set(faces.ravel()) == set(range(len(vertices)))
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    there, back = (sorted(map(tuple, each)) for each in (edges, edges[:, ::-1]))
    assert there == back
    corners = vertices[faces]
    assert np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() > 0


def test_a_net_lies_where_values_vanish():
    """A plane is met exactly, since values between grid points are interpolated linearly."""
    at = np.indices((8, 8, 8)).astype(float)
    slope = np.array([0.3, -0.2, 0.9])
    values = np.tensordot(slope, at, axes=1) - 3.1
    inner = (slice(1, -1),) * 3
    padded = np.pad(values[inner], 1, constant_values=9.0)
    vertices, _ = surface_net(padded)
    middle = vertices[((vertices > 1.01) & (vertices < 5.99)).all(axis=1)]
    assert len(middle) > 15
    np.testing.assert_allclose(middle @ slope, 3.1, atol=1e-9)


def test_sheets_of_a_cell():
    def sheets(*corners):
        signs = sum(1 << n for n, corner in enumerate(np.ndindex(2, 2, 2)) if corner in corners)
        edges = []
        for a in range(3):
            for n, (b, c) in enumerate(np.ndindex(2, 2)):
                ends = [tuple(np.roll((end, b, c), a)) in corners for end in (0, 1)]
                edges += [4 * a + n] if ends[0] != ends[1] else []
        found = isosurface._sheets()[signs, edges]
        assert set(found) == set(range(len(set(found))))
        return len(set(found))

    assert sheets((0, 0, 0)) == 1
    assert sheets((0, 0, 0), (0, 0, 1)) == 1
    assert sheets((0, 0, 0), (1, 1, 1)) == 2
    assert sheets((0, 0, 0), (0, 1, 1)) == 2  # on one face: apart
    assert sheets((0, 0, 0), (0, 1, 1), (1, 0, 1), (1, 1, 0)) == SHEETS == 4
    everything = set(np.ndindex(2, 2, 2))
    assert sheets(*(everything - {(0, 0, 0)})) == 1
    assert sheets(*(everything - {(0, 0, 0), (1, 1, 1)})) == 2
    assert sheets(*(everything - {(0, 0, 0), (0, 1, 1)})) == 1  # on one face: the inside is cut, not the outside
