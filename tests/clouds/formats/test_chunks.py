"""Reading of files in chunks gives what reading them whole gives."""

import numpy as np
import pytest

from pcsr import UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import read_cloud, write_cloud, write_points
from pcsr.clouds.formats.chunks import CHUNKED, open_chunks


def coloured(count=500, seed=0):
    rng = np.random.default_rng(seed)
    columns = {
        "red": rng.integers(0, 256, count).astype(np.uint8),
        "green": rng.integers(0, 256, count).astype(np.uint8),
        "blue": rng.integers(0, 256, count).astype(np.uint8),
        "weight": rng.normal(size=count),
        "label": rng.integers(0, 9, count).astype(np.int32),
    }
    return Cloud(rng.normal(size=(count, 3)) + np.array([500_000, 5_400_000, 100]), columns)


@pytest.mark.parametrize("size", [1, 128, 500, 1000])
@pytest.mark.parametrize("suffix", CHUNKED)
def test_the_chunks_are_the_cloud(tmp_path, suffix, size):
    write_cloud(tmp_path / f"a{suffix}", coloured())
    whole, parts = read_cloud(tmp_path / f"a{suffix}"), open_chunks(tmp_path / f"a{suffix}")
    chunks = list(parts.chunks(size))
    assert parts.count == 500
    assert max(map(len, chunks)) <= size
    np.testing.assert_array_equal(np.concatenate([chunk.points for chunk in chunks]), whole.points)
    assert list(chunks[0].columns) == list(whole.columns)
    for name, column in whole.columns.items():
        np.testing.assert_array_equal(np.concatenate([chunk.columns[name] for chunk in chunks]), column)
        assert chunks[0].columns[name].dtype == column.dtype
    assert chunks[0].is_single == whole.is_single


def test_arrays_in_fortran_order_are_read(tmp_path):
    table = np.asfortranarray(np.random.default_rng(0).normal(size=(50, 5)))
    np.save(tmp_path / "a.npy", table)
    chunks = list(open_chunks(tmp_path / "a.npy").chunks(16))
    np.testing.assert_array_equal(np.concatenate([chunk.points for chunk in chunks]), table[:, :3])
    np.testing.assert_array_equal(np.concatenate([chunk.columns["c4"] for chunk in chunks]), table[:, 4])


def test_big_endian_vertices_after_another_element_are_read(tmp_path):
    header = "ply\nformat binary_big_endian 1.0\nelement camera 2\nproperty double f\nelement vertex 3\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + "element face 1\nproperty list uchar int i\n"
    points = np.arange(9, dtype=">f4").reshape(3, 3)
    data = header.encode() + b"end_header\n" + np.ones(2, ">f8").tobytes() + points.tobytes() + bytes([0])
    (tmp_path / "a.ply").write_bytes(data)
    chunks = list(open_chunks(tmp_path / "a.ply").chunks(2))
    np.testing.assert_array_equal(np.concatenate([chunk.points for chunk in chunks]), points)


@pytest.mark.parametrize("suffix", CHUNKED)
def test_files_that_are_cut_off_are_refused(tmp_path, suffix):
    write_cloud(tmp_path / f"a{suffix}", coloured())
    data = (tmp_path / f"a{suffix}").read_bytes()
    (tmp_path / f"b{suffix}").write_bytes(data[: len(data) * 2 // 3])
    with pytest.raises(UserError, match=r"b\.\w+: (it is cut off|its compressed points are damaged)"):
        list(open_chunks(tmp_path / f"b{suffix}").chunks(100))


def test_what_cannot_be_read_in_parts_is_refused_with_the_remedy(tmp_path):
    write_points(tmp_path / "a.xyz", coloured().points)
    with pytest.raises(UserError, match=r"a\.xyz: a \.xyz file cannot be read in parts: convert it to LAS"):
        open_chunks(tmp_path / "a.xyz")
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    (tmp_path / "a.ply").write_text(f"ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n0 0 0\n")
    with pytest.raises(UserError, match="a PLY that is text cannot be read in parts: convert it to LAS"):
        open_chunks(tmp_path / "a.ply")
    np.save(tmp_path / "flat.npy", np.zeros(9))
    with pytest.raises(UserError, match=r"of shape \(9,\): points are real numbers of shape \(n, 3\)"):
        open_chunks(tmp_path / "flat.npy")
