from contextlib import nullcontext

import numpy as np
import pytest
import trimesh

from pcsr import PcsrWarning, UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes, read_cloud
from pcsr.clouds.meshes import read_mesh
from tests.clouds.reading import read_cloud_bytes

BOX = trimesh.creation.box((1, 2, 3))


def read(text, suffix):
    return read_cloud_bytes(text, suffix)


def found(cloud):
    return {name: column.tolist() for name, column in cloud.columns.items()}


@pytest.mark.parametrize("suffix", [".obj", ".off", ".stl", ".glb"])
def test_a_mesh_gives_its_vertices(tmp_path, suffix):
    path = tmp_path / f"box{suffix}"
    BOX.export(path)
    cloud = read_cloud(path)
    assert len(cloud) == 8
    assert {tuple(point) for point in cloud.points} == {tuple(vertex) for vertex in BOX.vertices}
    if suffix != ".stl":
        np.testing.assert_array_equal(cloud.points, BOX.vertices)


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("v 1 2 3\nv 4 5 6\n", {}),
        ("# v 9 9 9\no thing\n v 1 2 3 # it\nvt 0 0\nv\t4 5 6\r\nf 1 2 1\n", {}),
        ("v 1 2 3 1.0\nv 4 5 6 1.0\n", {}),
        ("v 1 2 3 0 0.5 1\nv 4 5 6 1 1 1\n", {"red": [0, 1], "green": [0.5, 1], "blue": [1, 1]}),
        ("v 1 2 3 0 1 2 3\nv 4 5 6 4 5 6 7\n", {"red": [0, 4], "green": [1, 5], "blue": [2, 6], "alpha": [3, 7]}),
        ("v 1 2 3\nv 4 5 6\nvn 0 0 1\nvn 0 1 0\n", {"nx": [0, 0], "ny": [0, 1], "nz": [1, 0]}),
        ("v 1 2 3\nvn 0 0 1\nv 4 5 6\nvn 0 1 0\nf 1//1 2//2 1//1\n", {"nx": [0, 0], "ny": [0, 1], "nz": [1, 0]}),
        ("v 1 2 3\nv 4 5 6\nvn 0 0 1\nvn 0 1 0\nf 1/7/1 2/8/1 1/9/1\n", {}),
        ("v 1 2 3\nv 4 5 6\nvn 0 0 1\n", {}),
    ],
)
def test_an_obj_gives_colours_and_the_normals_of_vertices(text, columns):
    cloud = read(text, ".obj")
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert found(cloud) == columns


def test_points_are_written_as_an_obj(tmp_path):
    columns = {"colors": np.array([[0, 51, 255]], np.uint8), "nx": np.zeros(1), "ny": np.ones(1), "nz": np.zeros(1)}
    data = cloud_bytes(Cloud(np.array([[0.1, 2, 3]]), columns), ".obj")
    assert data.decode() == "v 0.1 2.0 3.0 0.0 0.2 1.0\nvn 0.0 1.0 0.0\n"
    assert list(read(data, ".obj").columns) == ["red", "green", "blue", "nx", "ny", "nz"]
    assert cloud_bytes(read(data, ".obj"), ".obj") == data


@pytest.mark.parametrize("names", [["label"], ["nx", "ny"], ["red"], ["red", "green", "blue", "label"]])
def test_an_obj_holds_no_other_columns(names):
    columns = {name: np.zeros(1) for name in names}
    with pytest.raises(UserError, match=r"not the columns (label|of this cloud): write a \.ply"):
        cloud_bytes(Cloud(np.zeros((1, 3)), columns), ".obj")


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("OFF\n2 0 0\n1 2 3\n4 5 6\n", {}),
        ("OFF # it\n# more\n\n2 1 0\n1 2 3\n\n4 5 6\n3 0 1 1\n", {}),
        ("OFF 2 1 0\r\n1 2 3\r\n4 5 6\r\n3 0 1 1\r\n", {}),
        ("COFF\n2 0\n1 2 3 255 0 7\n4 5 6 1 1 1\n", {"red": [255, 1], "green": [0, 1], "blue": [7, 1]}),
        (
            "COFF\n2 0\n1 2 3 1 0 0.5 1\n4 5 6 0 0 0 0\n",
            {"red": [1, 0], "green": [0, 0], "blue": [0.5, 0], "alpha": [1, 0]},
        ),
        ("NOFF\n2 0 0\n1 2 3 0 0 1\n4 5 6 0 1 0\n", {"nx": [0, 0], "ny": [0, 1], "nz": [1, 0]}),
        (
            "CNOFF\n2 0 0\n1 2 3 0 0 1 9 8 7\n4 5 6 0 1 0 6 5 4\n",
            {"nx": [0, 0], "ny": [0, 1], "nz": [1, 0], "red": [9, 6], "green": [8, 5], "blue": [7, 4]},
        ),
        ("OFF\n2 0 0\n1 2 3 9 9\n4 5 6 9 9\n", {}),
    ],
)
def test_an_off_gives_colours_and_normals(text, columns):
    cloud = read(text, ".off")
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert found(cloud) == columns
    assert {column.dtype.kind for name, column in cloud.columns.items() if name == "red" and max(column) > 1} <= {"u"}


def test_a_scene_gives_all_vertices_in_their_places(tmp_path):
    scene = trimesh.Scene()
    mesh = BOX.copy()
    mesh.visual.vertex_colors = np.arange(32).reshape(8, 4).astype(np.uint8)
    scene.add_geometry(mesh)
    scene.add_geometry(mesh, transform=trimesh.transformations.translation_matrix((5, 0, 0)))
    scene.export(tmp_path / "two.glb", include_normals=True)
    cloud = read_cloud(tmp_path / "two.glb")
    order = np.argsort(cloud.points[:, 0] > 2, kind="stable")
    np.testing.assert_allclose(cloud.points[order[:8]], mesh.vertices)
    np.testing.assert_allclose(cloud.points[order[8:]], mesh.vertices + np.array([5, 0, 0]))
    assert list(cloud.columns) == ["red", "green", "blue", "alpha", "nx", "ny", "nz"]
    np.testing.assert_array_equal(cloud.columns["green"], np.tile(np.arange(1, 32, 4, dtype=np.uint8), 2))
    np.testing.assert_allclose(cloud.columns["nz"], np.tile(mesh.vertex_normals[:, 2], 2), rtol=1e-5)
    # What one of two lacks is not made up.
    scene.add_geometry(BOX)
    scene.export(tmp_path / "three.glb", include_normals=True)
    assert list(read_cloud(tmp_path / "three.glb").columns) == ["nx", "ny", "nz"]
    BOX.export(tmp_path / "plain.glb", include_normals=False)
    assert read_cloud(tmp_path / "plain.glb").columns == {}


def test_a_cloud_in_a_glb_is_read(tmp_path):
    points = np.arange(12.0).reshape(4, 3)
    colours = np.arange(16, dtype=np.uint8).reshape(4, 4)
    for notes in (None, colours):
        trimesh.PointCloud(points, colors=notes).export(tmp_path / "cloud.glb")
        cloud = read_cloud(tmp_path / "cloud.glb")
        np.testing.assert_array_equal(cloud.points, points)
        assert [column.tolist() for column in cloud.columns.values()] == ([] if notes is None else colours.T.tolist())


def test_normals_stay_upright_where_a_scene_is_stretched_and_turned(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=1)
    pose = trimesh.transformations.rotation_matrix(0.7, (1, 2, 3)) @ np.diag([1, 2, 5, 1])
    scene = trimesh.Scene()
    scene.add_geometry(ball, transform=pose)
    scene.export(tmp_path / "egg.glb", include_normals=True)
    cloud = read_cloud(tmp_path / "egg.glb")
    np.testing.assert_allclose(cloud.points, trimesh.transform_points(ball.vertices, pose), atol=1e-6)
    normals = np.stack([cloud.columns[name] for name in ("nx", "ny", "nz")], axis=1)
    # Of the egg x A x = 1 the normal at x is along A x.
    inverse = np.linalg.inv(pose[:3, :3])
    upright = cloud.points @ (inverse.T @ inverse)
    upright /= np.linalg.norm(upright, axis=1, keepdims=True)
    np.testing.assert_allclose((normals * upright).sum(axis=1), 1, atol=1e-3)


@pytest.mark.parametrize(
    ("suffix", "text", "reason"),
    [
        (".obj", "o thing\n", "holds no points"),
        (".obj", "v 1 2\n", "vertex 1 has 2 numbers: 3 are needed"),
        (".obj", "v 1 2 3\nv 1 2 3 0 0\n", "vertex 2 has 5 numbers: 3 are needed, 6 or 7 with colours"),
        (".obj", "v 1 2 x\n", "rows of numbers cannot be read: 'x' in row 1 is no number: it is damaged"),
        (".obj", "v 1,5 2 3\n", "'1,5' in row 1 is no number: write decimal points, not commas"),
        (".off", "OFF\n1 0 0\n1,5 2 3\n", "'1,5' in row 1 is no number: write decimal points, not commas"),
        (".obj", "v 1 2 3\nv 1 2 nan\n", "1 of 2 points"),
        (".off", "noise", "does not begin with 'OFF'"),
        (".off", "OFF BINARY\n1 2 3\n", "does not begin with 'OFF', or is binary"),
        (".off", "OFF\nthree\n", "its second line must be the numbers"),
        (".off", "OFF\n0 0 0\n", "holds no points"),
        (".off", "OFF\n3 0 0\n1 2 3\n4 5 6\n", "cut off: 2 of its 3 points"),
        (".off", "NOFF\n1 0 0\n1 2 3\n", "have 3 numbers each, at least 6"),
        (".glb", "glTF noise", "cannot be read as a .glb file"),
        (".stl", "solid nothing\nendsolid\n", "."),
    ],
)
def test_what_is_wrong_with_a_mesh_is_said(suffix, text, reason):
    with pytest.raises(UserError, match=reason) as caught:
        read(text, suffix)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("suffix", [".glb", ".stl", ".off"])
def test_a_mesh_that_is_cut_off_gives_a_reason_or_its_vertices(suffix):
    exported = BOX.export(file_type=suffix[1:])
    whole = exported.encode() if isinstance(exported, str) else exported
    refused = 0
    for length in range(0, len(whole), 7):
        try:
            assert len(read(whole[:length], suffix)) <= 8
        except UserError:
            refused += 1
    assert refused > 10


def test_triangles_are_read_as_one_mesh(tmp_path):
    scene = trimesh.Scene([BOX, BOX.copy().apply_translation((5, 0, 0))])
    scene.export(tmp_path / "two.glb")
    assert read_mesh(tmp_path / "two.glb").volume == pytest.approx(12)
    (tmp_path / "cloud.obj").write_text("v 1 2 3\n")
    (tmp_path / "noise.ply").write_text("ply noise")
    for name, reason in (
        ("cloud.obj", "has no faces|cannot be read"),
        ("noise.ply", ": it cannot"),
        ("no.ply", "cannot"),
    ):
        with pytest.raises(UserError, match=rf"{name} ?({reason})"):
            read_mesh(tmp_path / name)


RGB = {"red": [0, 0], "green": [0.5, 0.5], "blue": [1, 1]}
BLACK = "1 of 2 vertices have no colour and became black"


@pytest.mark.parametrize(
    ("text", "colours", "note"),
    [
        ("v 1 2 3 0 0.5 1\nv 4 5 6\n", RGB | {"green": [0.5, 0], "blue": [1, 0]}, BLACK),
        ("v 1 2 3 1.0\nv 4 5 6 0 0.5 1 1\n", RGB | {"green": [0, 0.5], "blue": [0, 1], "alpha": [0, 1]}, BLACK),
        ("v 1 2 3 0 0.5 1\nv 4 5 6 0 0.5 1 1\n", RGB, ""),
        ("v 1 2 3 0 0.5 1 0\nv 4 5 6 0 0.5 1 1\n", RGB | {"alpha": [0, 1]}, ""),
        ("v 1 2 3 1.0\nv 4 5 6\n", {}, ""),
        ("v 1 2 \\\n3\nv 4 5 6\n", {}, ""),
    ],
)
def test_vertices_with_and_without_colours(text, colours, note):
    with pytest.warns(PcsrWarning, match=note) if note else nullcontext():
        cloud = read(text, ".obj")
    assert cloud.points.tolist() == [[1, 2, 3], [4, 5, 6]]
    assert {name: column.tolist() for name, column in cloud.columns.items()} == colours


@pytest.mark.parametrize("kind", ["u1", "u2", "i8"])
def test_integer_colours_of_any_size_are_shares_in_an_obj(kind):
    most = {"u1": 255, "u2": 65535, "i8": 65535}[kind]
    colours = {name: np.array([0, most], kind) for name in ("red", "green", "blue")}
    data = cloud_bytes(Cloud(np.eye(3)[:2], colours), ".obj").decode()
    assert data == "v 1.0 0.0 0.0 0.0 0.0 0.0\nv 0.0 1.0 0.0 1.0 1.0 1.0\n"
