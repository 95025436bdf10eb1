"""A surface through a cloud. Most of it needs Open3D, and is skipped without."""

import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pcsr import UserError
from pcsr.clouds import reconstruction as surface
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.reconstruction import write_surface


@pytest.fixture
def library():
    try:
        return surface.open3d()
    except UserError as error:
        pytest.skip(str(error))


def half_ball(count=4000, shift=0.0):
    points = np.random.default_rng(0).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    points[:, 2] = np.abs(points[:, 2])
    normals = {name: points[:, k].astype(np.float32) for k, name in enumerate(("nx", "ny", "nz"))}
    return Cloud(points + shift, normals)


@pytest.mark.open3d
@pytest.mark.parametrize("suffix", [".ply", ".stl", ".obj"])
def test_a_surface_goes_through_the_points_and_ends_where_they_do(library, tmp_path, suffix):
    path = tmp_path / f"mesh{suffix}"
    count = write_surface(path, half_ball(shift=1e6))
    mesh = trimesh.load(path, process=False)
    assert len(mesh.faces) == count > 500
    local = np.asarray(mesh.vertices) - 1e6
    assert np.abs(np.linalg.norm(local, axis=1) - 1).max() < (0.15 if suffix == ".stl" else 0.08)
    assert local[:, 2].min() > -0.25, "the half that is not there stays open"


@pytest.mark.open3d
def test_without_normals_they_are_estimated(library, tmp_path):
    assert write_surface(tmp_path / "mesh.ply", Cloud(half_ball().points, {})) > 500


def test_without_open3d_the_extra_is_named(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "open3d", None)
    with pytest.raises(UserError, match=r"needs open3d, which is not installed: pip install 'pcsr\[open3d\]'"):
        write_surface(tmp_path / "mesh.ply", half_ball(20))
    assert list(tmp_path.iterdir()) == []


def test_a_suffix_of_no_mesh_is_named():
    with pytest.raises(UserError, match=r"no mesh format '\.xyz': \.ply, \.obj"):
        write_surface(Path("mesh.xyz"), half_ball(20))
