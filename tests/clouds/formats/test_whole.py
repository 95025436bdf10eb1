"""What holds for all formats: whole clouds come back, damaged files and wrong suffixes are named."""

import string
import warnings
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from pcsr import PcsrWarning, UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import COLOUR_BLOCKS, NORMAL_BLOCKS
from pcsr.clouds.formats import (
    CLOUD_READERS,
    CLOUD_WRITERS,
    cloud_bytes,
    read_cloud,
    read_points,
    writable,
    write_cloud,
)
from tests.clouds.reading import read_cloud_bytes

INTEGERS = [f"{sign}{size}" for sign in "iu" for size in (1, 2, 4, 8)]
HOLDS = {
    ".ply": ["u1", "i1", "u2", "i2", "u4", "i4", "f4", "f8"],
    ".pcd": [*INTEGERS, "f4", "f8"],
    ".npz": [*INTEGERS, "f2", "f4", "f8", "?"],
    ".csv": ["i8", "f8"],
    ".xyz": ["i8", "f8"],
    ".txt": ["i8", "f8"],
}
"""The types that come back as they were."""
WIDTHS = {".ply": [1, 2, 3], ".pcd": [2, 3], ".npz": [0, 1, 3], ".csv": [], ".xyz": [], ".txt": []}
"""The widths of columns of more than one number that do."""
MINE = [suffix for suffix in CLOUD_WRITERS if suffix not in (".las", ".laz")]
METRES = np.array([[4_512_345.678, 5_398_765.432, 312.001], [4_512_345.679, 5_398_765.433, -0.001], [1 / 3, 1e-300, 7]])
names = st.text(string.ascii_letters, min_size=4, max_size=8).filter(
    lambda name: name.lower() not in (*COLOUR_BLOCKS, *NORMAL_BLOCKS)
)


def equal(one, other):
    assert one.points.tobytes() == other.points.tobytes()
    assert list(one.columns) == list(other.columns)
    for name, column in one.columns.items():
        assert column.dtype == other.columns[name].dtype
        assert column.dtype.isnative
        np.testing.assert_array_equal(column, other.columns[name])
    return True


@st.composite
def clouds(draw, suffix):
    n = draw(st.integers(1, 5))
    columns = {}
    for name in draw(st.lists(names, max_size=4, unique_by=str.lower)):
        kind = np.dtype(draw(st.sampled_from(HOLDS[suffix])))
        widths = draw(st.sampled_from([None, *WIDTHS[suffix]]))
        shape = (n,) if widths is None else (n, widths)
        text = not WIDTHS[suffix]
        columns[name] = draw(arrays.arrays(kind, shape, elements={"allow_nan": not text} if kind.kind == "f" else None))
    finite = st.floats(allow_nan=False, allow_infinity=False)
    return Cloud(draw(arrays.arrays(np.float64, (n, 3), elements=finite)), columns)


@pytest.mark.parametrize("suffix", HOLDS)
@settings(max_examples=40)
@given(data=st.data())
def test_what_is_written_is_what_is_read(suffix, data):
    cloud = data.draw(clouds(suffix))
    again = read_cloud_bytes(cloud_bytes(cloud, suffix), suffix)
    equal(cloud, again)
    equal(cloud, read_cloud_bytes(cloud_bytes(again, suffix), suffix))


@pytest.mark.parametrize("suffix", MINE)
def test_millimetres_in_millions_of_metres_survive(tmp_path, suffix):
    path = tmp_path / f"cloud{suffix.upper()}"
    write_cloud(path, Cloud(METRES))
    assert read_cloud(path).points.tobytes() == METRES.tobytes()
    if suffix != ".obj":
        assert read_points(path).tobytes() == METRES.tobytes()


@pytest.mark.parametrize("suffix", sorted({*MINE} - {".pts"}))  # which holds no normals
def test_colours_and_normals_go_from_each_format_to_each(suffix):
    n = len(METRES)
    columns = {
        "colors": np.arange(3 * n, dtype=np.uint8).reshape(n, 3) * 20,
        "normals": np.eye(3)[:n],
    }
    first = read_cloud_bytes(cloud_bytes(Cloud(METRES, columns), ".ply"), ".ply")
    assert list(first.columns) == ["red", "green", "blue", "nx", "ny", "nz"]
    there = read_cloud_bytes(cloud_bytes(first, suffix), suffix)
    back = read_cloud_bytes(cloud_bytes(there, ".npz"), ".npz")
    named = list(first.columns) if suffix != ".npy" else [f"c{i}" for i in range(3, 9)]
    assert list(back.columns) == named
    for name, column in zip(named, first.columns.values(), strict=True):
        share = 255 if suffix == ".obj" and column.dtype == np.uint8 else 1  # an .obj holds colours from 0 to 1
        np.testing.assert_allclose(back.columns[name] * share, column)


def test_suffixes_that_are_written_are_read_and_meshes_are_not_written(tmp_path):
    assert CLOUD_READERS.keys() - CLOUD_WRITERS.keys() == {".off", ".stl", ".glb", ".e57", ".ptx"}
    assert CLOUD_WRITERS.keys() < CLOUD_READERS.keys()
    for use in (lambda path: write_cloud(path, Cloud(METRES)), writable):
        with pytest.raises(UserError, match=r"no cloud format '.stl': .asc, .*, .xyz can be written"):
            use(tmp_path / "a.stl")
        with pytest.raises(UserError, match=r"no cloud format '.abc': .* are known"):
            use(tmp_path / "a.abc")
    for suffix in MINE:
        writable(tmp_path / f"a{suffix.upper()}")
    assert list(tmp_path.iterdir()) == []


CONTENT = Cloud(METRES, {"label": np.array([1, 20, 300], "i4"), "red": np.array([7, 8, 9], "u1")})


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npy", ".npz"])
def test_a_binary_file_that_is_cut_off_anywhere_is_refused(suffix):
    whole = cloud_bytes(CONTENT, suffix)
    for length in range(len(whole)):
        with pytest.raises(UserError):
            read_cloud_bytes(whole[:length], suffix)


ASCII = {
    ".ply": {"ply": {"encoding": "ascii"}},
    ".pcd": {"pcd": {"encoding": "ascii"}},
    ".xyz": {},
    ".csv": {},
}


@pytest.mark.filterwarnings("ignore::pcsr.PcsrWarning")
@pytest.mark.parametrize("suffix", ASCII)
def test_text_that_is_cut_off_is_refused_or_loses_the_end_alone(suffix):
    whole = cloud_bytes(Cloud(CONTENT.points, CONTENT.columns, ASCII[suffix]), suffix)
    assert whole.isascii()
    read = 0
    for length in range(len(whole)):
        try:
            cloud = read_cloud_bytes(whole[:length], suffix)
        except UserError:
            continue
        read += 1
        rows = len(cloud) - 1  # digits that the last line lost cannot be missed
        assert rows == 2 or suffix in (".xyz", ".csv")
        assert cloud.points[:rows].tobytes() == METRES[:rows].tobytes()
    assert read > 0


@pytest.mark.filterwarnings("ignore::pcsr.PcsrWarning")
@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".npy", ".npz", ".xyz", ".csv", ".obj"])
@given(at=st.integers(0, 2000), byte=st.binary(min_size=1, max_size=3), encoded=st.booleans())
def test_bytes_that_are_changed_give_a_cloud_or_a_reason(suffix, at, byte, encoded):
    about = ASCII.get(suffix, {}) if encoded else {}
    columns = CONTENT.columns if suffix != ".obj" else {}
    whole = bytearray(cloud_bytes(Cloud(METRES, columns, about), suffix))
    at %= len(whole)
    whole[at : at + len(byte)] = byte
    with suppress(UserError), warnings.catch_warnings():
        warnings.simplefilter("ignore", PcsrWarning)
        cloud = read_cloud_bytes(bytes(whole), suffix)
        assert len(cloud) > 0
        assert np.isfinite(cloud.points).all()


@pytest.mark.parametrize("suffix", [".off", ".glb", ".stl", *MINE])
def test_an_empty_file_and_noise_are_named(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(b"")
    with pytest.raises(UserError, match=rf"a\{suffix} cannot be read as a \{suffix} file: it is empty \(0 bytes\)"):
        read_cloud(path)
    path.write_bytes(b"\x00\xff noise")
    with pytest.raises(UserError, match=rf"a\{suffix}"):
        read_cloud(path)


@pytest.mark.parametrize(
    ("suffix", "claimed"), [(".ply", ".xyz"), (".pcd", ".ply"), (".npy", ".csv"), (".npz", ".npy"), (".ply", ".obj")]
)
def test_a_file_of_another_kind_than_its_suffix_says_is_named(suffix, claimed):
    data = cloud_bytes(Cloud(METRES), suffix)
    with pytest.raises(UserError, match=rf"it is a \{suffix} file by its content, not a \{claimed}: rename it"):
        read_cloud_bytes(data, claimed)


def test_text_that_is_called_a_ply_is_named():
    with pytest.raises(UserError, match="it does not begin with 'ply'"):
        read_cloud_bytes(b"1 2 3\n", ".ply")


@pytest.mark.parametrize("suffix", [".npy", ".xyz", ".csv"])
def test_rows_that_are_not_finite_are_refused_or_dropped(tmp_path, suffix):
    points = METRES.copy()
    points[1, 2] = np.nan
    path = tmp_path / f"a{suffix}"
    if suffix == ".npy":
        np.save(path, np.column_stack([points, [1, np.nan, np.inf]]))
    else:
        path.write_text("1 2 3 1\n1 2 nan nan\n4 5 6 inf\n".replace(" ", "," if suffix == ".csv" else " "))
    with pytest.raises(UserError, match=r"1 of 3 points have a coordinate that is not finite: remove them, or .*drop"):
        read_cloud(path)
    cloud = read_cloud(path, bad="drop")
    assert (len(cloud), cloud.about["dropped"]) == (2, 1)
    # Other columns may hold anything.
    assert cloud.columns["c3"].tolist() == [1, np.inf]
    (tmp_path / "b.xyz").write_text("nan 1 2\n")
    with pytest.raises(UserError, match="none of its 1 points has coordinates that are all finite"):
        read_cloud(tmp_path / "b.xyz", bad="drop")
    write_cloud(path, cloud)
    assert read_cloud(path, bad="drop").about["dropped"] == 0


def test_what_cannot_be_written_leaves_what_was_there(tmp_path):
    path = tmp_path / "a.ply"
    write_cloud(path, CONTENT)
    before = path.read_bytes()
    for cloud, reason in [
        (Cloud(np.zeros((0, 3))), "holds no points"),
        (Cloud(METRES * np.nan), "3 of 3 points"),
        (Cloud(METRES, {"id": np.full(3, 2**60 + 1)}), "no integers as large as those of column 'id': write a .npz"),
    ]:
        with pytest.raises(UserError, match=reason):
            write_cloud(path, cloud)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["a.ply"]
    (tmp_path / "b.ply").mkdir()
    with pytest.raises(UserError, match=r"b\.ply is a folder"):
        write_cloud(tmp_path / "b.ply", CONTENT)
    with pytest.raises(UserError, match=r"none\.ply cannot be read: No such file"):
        read_cloud(tmp_path / "none.ply")
