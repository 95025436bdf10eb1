import numpy as np
import pytest
import trimesh

from pcsr import PcsrWarning, UserError
from tests.clouds.reading import read_cloud_bytes

BOX = trimesh.creation.box()
BINARY, TEXT = BOX.export(file_type="stl"), BOX.export(file_type="stl_ascii").encode()
NAMED = b"solid with a name".ljust(80) + BINARY[80:]


def corners(data):
    return sorted(map(tuple, read_cloud_bytes(data, ".stl").points.tolist()))


@pytest.mark.parametrize("data", [BINARY, NAMED, TEXT, TEXT.replace(b"\n", b"\r\n"), TEXT.upper(), TEXT + TEXT])
def test_text_and_binary_are_read(data):
    assert corners(data) == sorted(map(tuple, BOX.vertices.tolist()))


@pytest.mark.parametrize("data", [BINARY, NAMED, TEXT])
def test_every_truncation_is_refused(data):
    for length in [*range(1, len(data) - 10, 37), len(data) - 10]:
        with pytest.raises(UserError, match=r"cut off|holds no points"):
            read_cloud_bytes(data[:length], ".stl")


def test_bytes_after_the_triangles_are_left_out():
    with pytest.warns(PcsrWarning, match="it goes on for 7 bytes after its 12 triangles: these were left out"):
        assert len(read_cloud_bytes(BINARY + bytes(7), ".stl")) == 8


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        (b"vertex -0.5", b"vertex -0.5o", "'-0.5o' in row . is no number"),
        (b"vertex", b"vortex", "its 12 facets have 35 vertices"),
        (b"endfacet", b"", "it is cut off or damaged: 11 of its facets are complete"),
    ],
)
def test_damaged_text_is_refused(old, new, reason):
    assert old in TEXT
    with pytest.raises(UserError, match=reason):
        read_cloud_bytes(TEXT.replace(old, new, 1), ".stl")


def test_points_are_as_trimesh_reads_them():
    ball = trimesh.creation.icosphere(2)
    points = read_cloud_bytes(ball.export(file_type="stl"), ".stl").points
    assert {*map(tuple, points.tolist())} == {*map(tuple, ball.vertices.astype(np.float32).tolist())}
