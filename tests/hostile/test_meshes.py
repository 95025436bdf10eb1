"""Meshes that a stranger hands to `pcsr evaluate --mesh` and `pcsr upsample`."""

import json
import struct

import numpy as np
import pytest

POINTS = np.random.default_rng(0).normal(size=(40, 3))
TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()


@pytest.fixture
def measured(limited, tmp_path):
    """Measures a cloud beside itself and a mesh, whose content is given."""
    np.save(tmp_path / "a.npy", POINTS)

    def measure(name, content):
        (tmp_path / name).write_bytes(content)
        return limited("evaluate", "a.npy", "a.npy", "--mesh", name, "--metric", "p2f", folder=tmp_path)

    return measure


def positions(count, **more):
    return {"componentType": 5126, "count": count, "type": "VEC3", **more}


def glb(**tree):
    """One triangle, and what `tree` says instead of the usual scene."""
    whole = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [positions(3, bufferView=0)],
        "bufferViews": [{"buffer": 0, "byteLength": len(TRIANGLE)}],
        "buffers": [{"byteLength": len(TRIANGLE)}],
    } | tree
    text = json.dumps(whole).encode()
    text += b" " * (-len(text) % 4)
    parts = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(TRIANGLE), b"BIN\0") + TRIANGLE
    return struct.pack("<4sII", b"glTF", 2, 12 + len(parts)) + parts


def test_a_scene_is_read(measured):
    outcome = measured("a.glb", glb())
    assert outcome.code == 0, outcome.err


@pytest.mark.parametrize(
    ("tree", "words"),
    [
        ({"nodes": [{"mesh": 0, "children": [1]}, {"children": [0]}]}, ["ancestor of itself"]),
        ({"nodes": [{"children": [1, 1]}, {"mesh": 0}]}, ["two parents"]),
        ({"nodes": [{"children": [n + 1, n + 1]} for n in range(60)] + [{"mesh": 0}]}, ["two parents"]),
        ({"nodes": [{"mesh": 0}] * 100_001}, ["100001 nodes", "100000"]),
        ({"nodes": [{"mesh": 7}]}, ["does not describe a scene"]),
        ({"nodes": 5}, ["does not describe a scene"]),
        ({"accessors": [positions(10**12, bufferView=0)]}, ["1000000000000"]),
        ({"accessors": [positions(10**12)]}, ["would become"]),
        ({"accessors": [positions(10**5)], "nodes": [{"mesh": 0}] * 10**4}, ["GB"]),
    ],
)
def test_scenes_that_are_no_tree_or_far_too_large(measured, tree, words):
    measured("a.glb", glb(**tree)).refused("a.glb", *words, megabytes=100)


def test_a_scene_in_very_deep_json(measured):
    text = b'{"nodes":' + b"[" * 100_000
    measured("a.glb", struct.pack("<4sII", b"glTF", 2, 0) + struct.pack("<I4s", len(text), b"JSON") + text).refused(
        "a.glb", "nested too deeply"
    )


VERTICES = "0 0 0\n1 0 0\n0 1 0\n"


@pytest.mark.parametrize("face", ["0 1 3", "-1 0 1", "0 1 99999999999", "0 1 4294967296"])
@pytest.mark.parametrize("kind", ["off", "ply", "obj"])
def test_faces_that_name_vertices_which_are_not_there(measured, kind, face):
    if kind == "off":
        text = f"OFF\n3 1 0\n{VERTICES}3 {face}\n"
    elif kind == "ply":
        axes = "".join(f"property float {axis}\n" for axis in "xyz")
        head = (
            f"ply\nformat ascii 1.0\nelement vertex 3\n{axes}element face 1\nproperty list uchar int vertex_indices\n"
        )
        text = f"{head}end_header\n{VERTICES}3 {face}\n"
    else:
        counted = " ".join(str(int(number) + 1) for number in face.split()).replace("0", "-9", 1)
        text = "".join(f"v {row}\n" for row in VERTICES.splitlines()) + f"f {counted}\n"
    measured(f"a.{kind}", text.encode()).refused(f"a.{kind}")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.off", f"OFF\n3 1000000000000 0\n{VERTICES}"),
        ("a.off", f"OFF\n1000000000000 1 0\n{VERTICES}3 0 1 2\n"),
        ("a.stl", b"\0" * 80 + struct.pack("<I", 2**32 - 1) + b"\0" * 500),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 1000000000000\nproperty float x\nend_header\n1\n"),
        ("a.obj", "v 1 2 3\n" + "f 1 1 1 1 1 1\n"[:4]),
        ("a.zip", b"PK\3\4"),
        ("a.dae", b"<xml>"),
    ],
)
def test_headers_that_promise_too_much_and_other_kinds(measured, name, content):
    measured(name, content if isinstance(content, bytes) else content.encode()).refused(name, megabytes=60)


def test_devices_and_folders(limited, tmp_path):
    np.save(tmp_path / "a.npy", POINTS)
    (tmp_path / "a.stl").symlink_to("/dev/zero")
    (tmp_path / "a.off").mkdir()
    for name, what in (("a.stl", "a device"), ("a.off", "a folder")):
        limited("evaluate", "a.npy", "a.npy", "--mesh", name, folder=tmp_path).refused(name, what, megabytes=30)
