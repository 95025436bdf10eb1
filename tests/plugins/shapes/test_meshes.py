from multiprocessing.reduction import ForkingPickler
from pathlib import Path

import numpy as np
import pytest
import trimesh

from pcsr import UserError
from pcsr_plugins.shapes.meshes import SPLITS, SUFFIXES, Meshes, group_of

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
BOX = trimesh.creation.box((1, 2, 3))


@pytest.fixture
def folder(tmp_path):
    """Forty groups of two variants each, and ten files at the top."""
    square = SQUARE + "f 1 2 3\n"
    for group in range(40):
        (tmp_path / f"g{group:02d}").mkdir()
        for variant in "ab":
            (tmp_path / f"g{group:02d}" / f"{variant}.obj").write_text(square)
    for i in range(10):
        (tmp_path / f"top{i}.obj").write_text(square)
    (tmp_path / "notes.txt").write_text("not a mesh")
    return tmp_path


def splits(shapes):
    return {name: split for split in SPLITS for name in shapes.names(split)}


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format_is_read(tmp_path, suffix):
    path = tmp_path / "deep" / f"box{suffix}"
    path.parent.mkdir()
    BOX.export(path)
    item = Meshes(folder=str(tmp_path)).item(f"deep/box{suffix}")
    assert (item.name, item.group) == (f"deep/box{suffix}", "deep")
    assert item.mesh.is_watertight  # the corners that STL repeats are one again
    assert item.mesh.volume == pytest.approx(6)
    assert len(item.mesh.faces) == 12


def test_suffixes_in_capitals_count_and_other_files_do_not(tmp_path):
    BOX.export(tmp_path / "box.stl")
    (tmp_path / "box.stl").rename(tmp_path / "BOX.STL")
    (tmp_path / "readme.md").write_text("")
    (tmp_path / "folder.stl").mkdir()
    shapes = Meshes(folder=str(tmp_path), validation=0.0, test=0.0)
    assert shapes.names("train") == ["BOX.STL"]
    assert shapes.item("BOX.STL").mesh.volume == pytest.approx(6)


def test_a_scene_is_joined(tmp_path):
    moved = trimesh.transformations.translation_matrix((5, 0, 0))
    scene = trimesh.Scene()
    scene.add_geometry(BOX)
    scene.add_geometry(BOX, transform=moved)
    scene.export(tmp_path / "two.glb")
    mesh = Meshes(folder=str(tmp_path)).item("two.glb").mesh
    assert mesh.volume == pytest.approx(12)
    assert mesh.extents == pytest.approx((6, 2, 3))


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("quad.obj", SQUARE + "f 1 2 3 4\n"),
        ("quad.off", "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n"),
        # Its material is missing, and its corners have two textures each: they are merged all the same.
        ("seam.obj", "mtllib none.mtl\n" + SQUARE + "vt 0 0\nvt 1 1\nusemtl x\nf 1/1 2/1 3/1\nf 1/2 3/2 4/2\n"),
    ],
)
def test_quads_are_cut_in_two_and_textures_ignored(tmp_path, name, text):
    (tmp_path / name).write_text(text)
    mesh = Meshes(folder=str(tmp_path)).item(name).mesh
    assert mesh.faces.shape == (2, 3)
    assert len(mesh.vertices) == 4
    assert mesh.area == pytest.approx(1)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("curve.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n", "no faces"),
        ("empty.stl", "", "it is empty"),
        ("nan.obj", "v 0 0 nan\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", "not finite"),
        ("line.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n", "no area"),
        ("index.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 9\n", "a face names vertex 9, and there are 3"),
        ("noise.glb", "noise", "does not begin with 'glTF'"),
        ("noise.ply", "ply noise", "it does not begin with the line 'ply'"),
        ("noise.off", "noise", "it does not begin with 'OFF'"),
    ],
)
def test_a_useless_file_is_named_with_the_reason(tmp_path, name, content, reason):
    (tmp_path / name).write_text(content)
    with pytest.raises(UserError, match=f"{name}.*{reason}") as caught:
        Meshes(folder=str(tmp_path)).item(name)
    assert str(tmp_path) in str(caught.value)


def test_a_cloud_has_no_faces(tmp_path):
    trimesh.PointCloud(np.eye(3)).export(tmp_path / "cloud.ply")
    with pytest.raises(UserError, match=r"cloud\.ply has no faces"):
        Meshes(folder=str(tmp_path)).item("cloud.ply")


def test_every_file_falls_to_one_split_with_its_group(folder):
    shapes = Meshes(folder=str(folder), validation=0.2, test=0.2)
    found = splits(shapes)
    assert len(found) == sum(len(shapes.names(split)) for split in SPLITS) == 90
    assert set(found.values()) == set(SPLITS)
    assert all(found[f"g{group:02d}/a.obj"] == found[f"g{group:02d}/b.obj"] for group in range(40))
    assert all(shapes.names(split) == sorted(shapes.names(split)) for split in SPLITS)


def test_shares_are_kept_roughly(tmp_path):
    shapes = Meshes(folder=str(tmp_path), validation=0.2, test=0.3)
    fell = [shapes._split(f"group {i}") for i in range(4000)]
    assert fell.count("validation") == pytest.approx(800, rel=0.1)
    assert fell.count("test") == pytest.approx(1200, rel=0.1)


def test_the_split_does_not_depend_on_the_listing_or_on_other_files(folder, monkeypatch):
    before = splits(Meshes(folder=str(folder)))
    listed = sorted(folder.rglob("*"), reverse=True)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "rglob", lambda self, pattern: iter(listed))
        assert splits(Meshes(folder=str(folder))) == before
    (folder / "another.obj").write_text(SQUARE + "f 1 2 3\n")
    (folder / "g00" / "a.obj").unlink()
    after = splits(Meshes(folder=str(folder)))
    assert {name: after[name] for name in before if name != "g00/a.obj"} == {
        name: split for name, split in before.items() if name != "g00/a.obj"
    }


def test_another_seed_splits_otherwise(folder):
    assert splits(Meshes(folder=str(folder), seed=0)) != splits(Meshes(folder=str(folder), seed=1))


def test_groups():
    assert group_of("a.stl") == "a.stl"
    assert group_of("bolts/a.stl") == "bolts"
    assert group_of("bolts/m4/a.stl") == "bolts/m4"


def test_without_shares_all_files_train(folder):
    shapes = Meshes(folder=str(folder), validation=0.0, test=0.0)
    assert len(shapes.names("train")) == 90
    assert shapes.names("test") == []


def test_a_split_that_no_group_fell_to_says_how_to_fill_it(tmp_path):
    BOX.export(tmp_path / "box.stl")
    shapes = Meshes(folder=str(tmp_path), validation=1e-9)
    with pytest.raises(UserError, match=r"none of the 1 groups under .* fell to 'validation': take another seed"):
        shapes.names("validation")


def test_a_missing_folder_is_named():
    with pytest.raises(UserError, match=r"folder 'no/such' is not there: .*\.glb, \.obj, \.off, \.ply, \.stl"):
        Meshes(folder="no/such")


def test_an_empty_folder_is_named(tmp_path):
    with pytest.raises(UserError, match=r"no \.glb, \.obj, \.off, \.ply, \.stl file is anywhere under"):
        Meshes(folder=str(tmp_path)).names("train")


@pytest.mark.parametrize(("validation", "test"), [(0.5, 0.5), (-0.1, 0.1), (0.1, 1.0), (float("nan"), 0.1)])
def test_shares_that_leave_nothing_are_refused(tmp_path, validation, test):
    with pytest.raises(UserError, match=f"validation {validation} and test {test} must be shares"):
        Meshes(folder=str(tmp_path), validation=validation, test=test)


def test_an_unknown_split_is_named(folder):
    with pytest.raises(UserError, match="no split 'val'"):
        Meshes(folder=str(folder)).names("val")


@pytest.mark.parametrize("name", ["gone.stl", "../outside.obj", "g00"])
def test_only_files_under_the_folder_are_items(folder, name):
    (folder.parent / "outside.obj").write_text(SQUARE + "f 1 2 3\n")
    with pytest.raises(UserError, match=f"'{name}' is not a file under"):
        Meshes(folder=str(folder)).item(name)


def test_an_absolute_path_is_no_item(folder):
    with pytest.raises(UserError, match="is not a file under"):
        Meshes(folder=str(folder)).item(str(folder / "top0.obj"))


def test_what_a_worker_is_sent_is_small(folder):
    assert len(ForkingPickler.dumps(Meshes(folder=str(folder)))) < 600
