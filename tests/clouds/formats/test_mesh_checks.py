"""Damaged meshes, which trimesh would read in part or refuse in words of its own."""

import numpy as np
import pytest
import trimesh

from pcsr import UserError
from pcsr.clouds.formats import mesh_checks
from pcsr.clouds.meshes import read_mesh

VERTICES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n"
OFF = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n"
BOX = trimesh.creation.box()
TEXT = BOX.export(file_type="ply", encoding="ascii")
FOREIGN = ("dtype", "could not", "invalid literal", "unmatched", "inhomogeneous", "unexpected", "list index", "reshape")


def read(folder, name, content):
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return read_mesh(path)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("a.obj", f"{VERTICES}f 1 2 3\nf 0 1 2\n", "line 6: a face names vertex 0, and an OBJ counts vertices from 1"),
        ("a.obj", f"{VERTICES}f 1/1/1 2/1/1 0/1/1 # it\n", "line 5: a face names vertex 0"),
        ("a.obj", f"{VERTICES}f 1 2 9\n", "line 5: a face names vertex 9, and there are 4"),
        ("a.obj", f"{VERTICES}f 1 2 -9\n", "line 5: a face names vertex -9, and there are 4"),
        (
            "a.obj",
            f"{VERTICES}f 1 2 {'1' * 5000}\n",
            "line 5: a face names vertex 11111111111111111111, and there are 4",
        ),
        ("a.obj", f"{VERTICES}f 1 2 c\n", "line 5: a face has the corner 'c', which is no number"),
        ("a.obj", f"{VERTICES}v 1 2\nf 1 2 3\n", "vertex 5 has 2 numbers: 3 are needed"),
        ("a.obj", f"{VERTICES}v 1 2 x\nf 1 2 3\n", "'x' in row 5 is no number: it is damaged"),
        ("a.off", OFF + "3 0 1 9\n", "it is damaged, or not a .off file"),
        ("a.off", OFF, "it is cut off: 0 of its 1 faces are there"),
        ("a.off", OFF.replace("0 1 0\n", "0 1\n"), "row 3 has 2 numbers and the first has 3"),
        ("a.off", "OFF\nx y z\n", "its second line must be the numbers"),
        ("a.stl", BOX.export(file_type="stl")[:-7], "it is cut off: 11 of its 12 triangles are there"),
        (
            "a.stl",
            "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 a\n",
            "it is cut off or damaged: 0 of its facets",
        ),
        ("a.ply", BOX.export(file_type="ply")[:-7], "it is damaged, or not a .ply file"),
        (
            "a.ply",
            BOX.export(file_type="ply", encoding="ascii").rpartition(b"\n3")[0],
            "it is cut off: 19 of its 20 lines",
        ),
        ("a.glb", BOX.export(file_type="glb")[:-7], "a.glb"),
    ],
)
def test_what_is_damaged_is_said_with_its_place(tmp_path, name, content, reason):
    with pytest.raises(UserError, match=reason) as error:
        read(tmp_path, name, content)
    assert str(tmp_path / name) in str(error.value)
    assert not any(word in str(error.value) for word in FOREIGN)


def test_lines_are_counted_once_for_the_face_at_fault(monkeypatch):
    """Counted for every face, they took a minute in a file of 2 MB."""
    counted, count = [], mesh_checks._line
    monkeypatch.setattr(mesh_checks, "_line", lambda text, at: counted.append(at) or count(text, at))
    text = VERTICES + "f 1 2 3\n" * 50 + "f 1 2 9\n"
    assert mesh_checks.fault(text.encode(), ".obj") == "line 55: a face names vertex 9, and there are 4"
    assert len(counted) == 1


def test_what_is_allowed_is_read(tmp_path):
    for faces in ("f 1 2 3", "f -4 -3 -2", "f 1/1 2/2 3/3", "f 1//1 2//1 3//1", "f 1 2 \\\n3", "f 10 2 3"):
        more = "v 9 9 9\n" * 6 if "10" in faces else ""
        assert len(read(tmp_path, "a.obj", f"{VERTICES}{more}{faces}\n").faces) == 1
    for kind in ("obj", "off", "stl", "ply", "glb"):
        assert len(read(tmp_path, f"a.{kind}", BOX.export(file_type=kind)).faces) == 12


@pytest.mark.parametrize("kind", ["obj", "off", "stl", "ply", "glb"])
def test_damage_anywhere_is_said_in_our_words(tmp_path, kind):
    whole = BOX.export(file_type=kind)
    whole = whole if isinstance(whole, bytes) else whole.encode()
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(100):
        damaged = bytearray(whole)
        for at in rng.integers(0, len(whole), 4):
            damaged[at] = rng.integers(256)
        try:
            read(tmp_path, f"a.{kind}", bytes(damaged))
        except UserError as error:
            refused += 1
            message = str(error)
        else:
            continue
        assert not any(word in message for word in FOREIGN), message
    assert refused > 0
