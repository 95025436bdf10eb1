import numpy as np
import pytest
import trimesh

from pcsr import UserError
from pcsr_plugins.shapes.shared.soundness import check_mesh


def mesh(vertices, faces):
    return trimesh.Trimesh(np.array(vertices, float), np.array(faces), process=False)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_any_surface_passes_whatever_its_unit(scale, offset):
    box = trimesh.creation.box((1, 2, 3)).apply_translation((offset,) * 3).apply_scale(scale)
    assert check_mesh(box, "box") is box


def test_holes_and_several_bodies_pass():
    check_mesh(mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), "one triangle")
    both = trimesh.util.concatenate([trimesh.creation.box(), trimesh.creation.box().apply_translation((5, 0, 0))])
    check_mesh(both, "two boxes")


def test_a_hair_passes():
    check_mesh(trimesh.creation.cylinder(radius=1e-3, height=1000), "hair")


def test_a_vertex_that_no_face_uses_may_be_anything():
    check_mesh(mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [np.nan] * 3], [[0, 1, 2]]), "stray")


@pytest.mark.parametrize(
    ("vertices", "faces", "reason"),
    [
        ([[0, 0, 0], [1, 0, 0]], np.zeros((0, 3), int), "has no faces"),
        ([[0, 0, np.nan], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], "not finite"),
        ([[0, 0, np.inf], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], "not finite"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]], "not among its 3 vertices"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, -1]], "not among its 3 vertices"),
        ([[0.1, 0.2, 0.3], [0.2, 0.4, 0.6], [0.3, 0.6, 0.9]], [[0, 1, 2]], "no area: all of its 1 faces"),
        ([[7, 7, 7]] * 3, [[0, 1, 2]], "no area"),
    ],
)
def test_what_cannot_be_sampled_is_refused_by_name(vertices, faces, reason):
    with pytest.raises(UserError, match=f"^parts/x.stl .*{reason}"):
        check_mesh(mesh(vertices, faces), "parts/x.stl")


def test_faces_of_four_corners_are_refused():
    quads = mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    quads._data["faces"] = np.array([[0, 1, 2, 3]])
    with pytest.raises(UserError, match=r"x has faces of shape \(1, 4\): triangulate it"):
        check_mesh(quads, "x")
