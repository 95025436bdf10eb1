import numpy as np
import pytest
import trimesh
from manifold3d import Manifold

from pcsr_plugins.shapes.shared.surfaces import is_sound, surface_of, without_folds


def test_what_is_flat_open_or_in_two_is_not_sound():
    box = trimesh.creation.box((30, 30, 30))
    corner, other, third = box.faces[0]
    middle = box.vertices[[corner, other]].mean(axis=0)  # on an edge, so that one of its three faces is flat
    faces = [*box.faces[1:], (corner, other, 8), (other, third, 8), (third, corner, 8)]
    flat = trimesh.Trimesh([*box.vertices, middle], faces, process=False)
    assert flat.is_watertight
    assert np.sum(flat.area_faces < 1e-12) == 1
    assert is_sound(box)
    assert not is_sound(flat)
    assert not is_sound(trimesh.Trimesh(box.vertices, box.faces[1:], process=False))
    assert not is_sound(trimesh.Trimesh(box.vertices, box.faces[:, ::-1], process=False))
    assert not is_sound(trimesh.util.concatenate([box, box.copy().apply_translation((99, 0, 0))]))


def test_crumbs_are_dropped():
    cube = Manifold.cube((30.0, 30.0, 30.0))
    mesh = surface_of(cube + Manifold.cube((1.0, 1.0, 1.0)).translate((50, 0, 0)))
    assert mesh is not None
    assert mesh.volume == pytest.approx(27_000)


def test_folds_are_removed_and_nothing_else():
    box = trimesh.creation.box().faces
    fold = np.array([[0, 1, 2], [1, 0, 2], [3, 3, 4], [5, 6, 5]])
    rng = np.random.default_rng(0)
    mixed = rng.permutation(np.concatenate([box, fold + 8]))
    kept = without_folds(mixed)
    canonical = {tuple(np.roll(face, -face.argmin())) for face in box}
    assert {tuple(face) for face in kept} == canonical
    assert len(kept) == len(box)
