import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st

from pcsr import UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes, write_cloud
from pcsr.clouds.formats.ply import TYPES
from pcsr.clouds.formats.ply_writing import smallest
from tests.clouds.reading import read_cloud_bytes


def read(data):
    return read_cloud_bytes(data, ".ply")


def test_coordinates_are_floats_only_where_nothing_is_lost():
    about = {"ply": {"coordinates": "float"}}
    cloud = Cloud(np.array([[0.5, 1.25, 2.0]]), {}, about)
    assert b"property float x\n" in cloud_bytes(cloud, ".ply")
    for moved in (cloud.points + 0.1, cloud.points + 1e300):
        data = cloud_bytes(Cloud(moved, cloud.columns, cloud.about), ".ply")
        assert b"property double x\n" in data
        assert read(data).points.tobytes() == moved.tobytes()
    assert b"property double x\n" in cloud_bytes(Cloud(cloud.points), ".ply")


def test_other_programs_read_what_is_written(tmp_path):
    columns = {"red": np.array([1, 2], "u1"), "green": np.array([3, 4], "u1"), "blue": np.array([5, 6], "u1")}
    for about in ({}, {"ply": {"encoding": "ascii"}}, {"ply": {"encoding": "binary_big_endian"}}):
        write_cloud(tmp_path / "a.ply", Cloud(np.eye(3)[:2], columns, about))
        loaded = trimesh.load(tmp_path / "a.ply")
        assert loaded.vertices.tolist() == [[1, 0, 0], [0, 1, 0]]
        assert loaded.colors[:, :3].tolist() == [[1, 3, 5], [2, 4, 6]]


@given(values=st.lists(st.integers(-(2**53), 2**53), min_size=1, max_size=4))
def test_integers_take_a_type_that_holds_them(values):
    column = np.array(values)
    kind = smallest(column, "it")
    assert kind.str[1:] in TYPES.values()
    assert column.astype(kind).astype(np.int64).tolist() == values


@pytest.mark.parametrize(
    ("column", "kind"),
    [
        (np.array([True, False]), "u1"),
        (np.array([0, 255]), "u1"),
        (np.array([0, 256]), "i4"),
        (np.array([2**32 - 1], np.uint64), "u4"),
        (np.array([2**40]), "f8"),
        (np.array([1.5], np.float16), "f4"),
        (np.array([1.5], np.longdouble), "f8"),
        (np.array([-7], np.int8), "i1"),
    ],
)
def test_types_that_ply_lacks_take_the_next(column, kind):
    assert smallest(column, "it") == np.dtype(kind)


def test_integers_that_no_type_holds_are_refused():
    for column in (np.array([2**63], np.uint64), np.array([-(2**60)])):
        with pytest.raises(UserError, match="no integers as large as those of column 'id'"):
            smallest(column, "id")
