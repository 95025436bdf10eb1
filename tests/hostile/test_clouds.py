"""Clouds that a stranger hands to `pcsr upsample`: refused in one line, soon, and without much memory."""

import gzip
import os
import struct
import zipfile
import zlib

import numpy as np
import pytest

from pcsr import UserError
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes, read_cloud
from pcsr.clouds.formats.beginnings import BEGINNINGS

POINTS = np.random.default_rng(0).normal(size=(40, 3))
AXES = "".join(f"property float {axis}\n" for axis in "xyz")
PLY = "ply\nformat {form} 1.0\nelement {name} {n}\n{more}" + AXES + "end_header\n"


def npy_header(shape, descr="<f8"):
    text = f"{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n".encode()
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(text)) + text


def bomb(path, gigabytes, shape):
    """A zip that becomes so many gigabytes of zeros, as NumPy's array: one deflated megabyte, again and again."""
    head = npy_header(shape)
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    start = packer.compress(head) + packer.flush(zlib.Z_FULL_FLUSH)
    block = packer.compress(bytes(1 << 20)) + packer.flush(zlib.Z_FULL_FLUSH)
    packed = start + block * (gigabytes << 10) + packer.flush()
    sizes = struct.pack("<QQ", len(head) + (gigabytes << 30), len(packed))
    name, extra = b"points.npy", struct.pack("<HH", 1, 16) + sizes
    common = struct.pack("<HHHHHIIIHH", 45, 0, 8, 0, 33, 0, 0xFFFFFFFF, 0xFFFFFFFF, len(name), len(extra))
    member = b"PK\3\4" + common + name + extra + packed
    entry = b"PK\1\2" + struct.pack("<H", 45) + common + bytes(14) + name + extra
    end = struct.pack("<HHHHIIH", 0, 0, 1, 1, len(entry), len(member), 0)
    path.write_bytes(member + entry + b"PK\5\6" + end)
    return len(member) + len(entry) - 16  # where the directory says how large the member becomes


def sparse(path, size, head=b""):
    with path.open("wb") as file:
        file.write(head)
        file.truncate(size)


def refused(limited, folder, name, *words, **bounds):
    limited("upsample", name, "-o", "out.ply", "--model", "midpoint", folder=folder).refused(*words, **bounds)
    assert not (folder / "out.ply").exists()


@pytest.mark.parametrize("gigabytes", [3, 10])
def test_an_archive_that_becomes_gigabytes(limited, tmp_path, gigabytes):
    bomb(tmp_path / "in.npz", gigabytes, (gigabytes << 25, 4))
    with zipfile.ZipFile(tmp_path / "in.npz") as archive, archive.open("points.npy") as file:
        assert np.lib.format.read_magic(file) == (1, 0)  # it is an archive that NumPy would inflate
    words = f"would become {gigabytes * 1.0737:.3g} GB", "more than 100 times as much"
    refused(limited, tmp_path, "in.npz", *words, megabytes=60)


@pytest.mark.parametrize(
    ("points", "said", "words"),
    [
        (10**12, 1000, "points.npy"),
        (10**12, 100 << 20, "2.4e+04 GB"),
        (10**12, 1 << 60, "would become"),
        (1000, 30_000, "it goes on after its array"),  # there are far more bytes than the directory and the header say
    ],
)
def test_an_archive_whose_directory_lies(limited, tmp_path, points, said, words):
    at = bomb(tmp_path / "in.npz", 1, (points, 3))
    with (tmp_path / "in.npz").open("r+b") as file:
        file.seek(at)
        file.write(struct.pack("<Q", said))
    refused(limited, tmp_path, "in.npz", words, megabytes=60)


@pytest.mark.parametrize("name", ["in.npy", "in.npz"])
def test_a_header_of_a_trillion_points(limited, tmp_path, name):
    data = npy_header((10**12, 3)) + bytes(1000)
    if name == "in.npz":
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            archive.writestr("points.npy", data)
    else:
        (tmp_path / name).write_bytes(data)
    refused(limited, tmp_path, name, name, "(1000000000000, 3)", "2.4e+04 GB", megabytes=30)


@pytest.mark.parametrize("member", ["points", "label"])
def test_objects_are_not_unpacked(limited, tmp_path, member):
    arrays = {"points": POINTS, "label": np.arange(40)} | {member: np.array([{}] * 40, dtype=object)}
    np.savez(tmp_path / "in.npz", **arrays)
    refused(limited, tmp_path, "in.npz", f"{member}.npy", "dtype object")


@pytest.mark.parametrize("suffix", [".xyz", ".csv", ".obj", ".off"])
def test_a_line_without_end(limited, tmp_path, suffix):
    sparse(
        tmp_path / f"in{suffix}",
        1 << 30,
        b"OFF\n" if suffix == ".off" else b"v 1 2 3\n" if suffix == ".obj" else b"1,2,3\n",
    )
    refused(limited, tmp_path, f"in{suffix}", f"in{suffix}", "a line of more than 1048576 bytes", megabytes=60)


def test_lines_that_are_empty(limited, tmp_path):
    (tmp_path / "in.xyz").write_bytes(b"1 2 3\n" + b"\n" * 30_000_000)
    refused(limited, tmp_path, "in.xyz", "lines, nearly all of them empty", megabytes=150)


def test_rows_of_half_a_million_columns(limited, tmp_path):
    (tmp_path / "in.xyz").write_bytes((b"1 " * 500_000 + b"\n") * 2)
    refused(limited, tmp_path, "in.xyz", "500000 columns", "4096", megabytes=200)


@pytest.mark.parametrize("suffix", sorted(BEGINNINGS))
def test_files_of_terabytes(limited, tmp_path, suffix):
    sparse(tmp_path / f"in{suffix}", 1 << 40, BEGINNINGS[suffix])
    refused(limited, tmp_path, f"in{suffix}", f"in{suffix}", "1.1e+03 GB", "17.2 GB", megabytes=30)


def test_files_larger_than_the_memory(limited, tmp_path):
    sparse(tmp_path / "in.xyz", 15 << 30)
    refused(limited, tmp_path, "in.xyz", "in.xyz (16.1 GB) needs about 177 GB of memory", megabytes=30)


@pytest.mark.parametrize("suffix", [".ply", ".xyz", ".npz", ".laz", ".stl"])
def test_packed_files_that_are_called_clouds(limited, tmp_path, suffix):
    (tmp_path / f"in{suffix}").write_bytes(gzip.compress(cloud_bytes(Cloud(POINTS), ".ply")))
    refused(limited, tmp_path, f"in{suffix}", "a gzip file by its content", "unpack")


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian"])
def test_a_ply_of_a_trillion(limited, tmp_path, form):
    (tmp_path / "in.ply").write_bytes(PLY.format(form=form, name="vertex", n=10**12, more="").encode() + b"1 2 3\n" * 9)
    refused(limited, tmp_path, "in.ply", "cut off", "1000000000000", megabytes=30)


def test_a_ply_with_lists_of_billions(limited, tmp_path):
    head = PLY.format(form="binary_little_endian", name="vertex", n=2, more="property list uint double a\n").encode()
    (tmp_path / "in.ply").write_bytes(head + struct.pack("<I", 1 << 31) + bytes(5000))
    refused(limited, tmp_path, "in.ply", "a list of 2147483648 numbers", megabytes=30)


def test_a_ply_with_uneven_lists_before_its_vertices(limited, tmp_path):
    more = "property list uchar uchar a\nelement vertex 1\n"
    head = PLY.format(form="binary_little_endian", name="face", n=2_000_000, more=more).encode()
    (tmp_path / "in.ply").write_bytes(head + b"\0\1a" * 1_000_000 + bytes(12))
    refused(limited, tmp_path, "in.ply", "all 1 points of in.ply lie on one spot", megabytes=60)
    (tmp_path / "in.ply").write_bytes(head.replace(b"2000000", b"20000000") + b"\0\1a" * 1_000_000)
    refused(limited, tmp_path, "in.ply", "cut off: at most", "of its 20000000 of 'face' are there", megabytes=60)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ((b" 40\n", b" 1000000000000\n"), ["1000000000000"]),
        ((b"COUNT 1", b"COUNT 1000000000"), ["COUNT", "10000"]),
        ((b"SIZE 8", b"SIZE 9"), ["TYPE and SIZE"]),
        ((b"HEIGHT 1", b"HEIGHT -1"), ["HEIGHT"]),
    ],
)
@pytest.mark.parametrize("encoding", ["ascii", "binary", "binary_compressed"])
def test_a_pcd_whose_header_lies(limited, tmp_path, encoding, change, words):
    data = cloud_bytes(Cloud(np.round(POINTS), {}, {"pcd": {"encoding": encoding}}), ".pcd")
    (tmp_path / "in.pcd").write_bytes(data.replace(*change))
    refused(limited, tmp_path, "in.pcd", "in.pcd", *words, megabytes=60)


def test_a_pcd_that_becomes_gigabytes(limited, tmp_path):
    data = cloud_bytes(Cloud(np.round(POINTS), {}, {"pcd": {"encoding": "binary_compressed"}}), ".pcd")
    data = data.replace(b"POINTS 40", b"POINTS 170000000").replace(b"WIDTH 40", b"WIDTH 170000000")
    at = data.index(b"compressed\n") + 11
    (tmp_path / "in.pcd").write_bytes(data[: at + 4] + struct.pack("<I", 24 * 170_000_000) + data[at + 8 :])
    refused(limited, tmp_path, "in.pcd", "would become 4.08 GB", megabytes=60)


@pytest.mark.parametrize(("at", "size", "value"), [(247, 8, 10**12), (100, 4, 2**31), (105, 2, 0), (96, 4, 2**32 - 1)])
@pytest.mark.parametrize("suffix", [".las", ".laz"])
def test_a_las_whose_header_lies(limited, tmp_path, suffix, at, size, value):
    data = bytearray(cloud_bytes(Cloud(POINTS), suffix))
    data[at : at + size] = value.to_bytes(size, "little")
    (tmp_path / f"in{suffix}").write_bytes(data)
    refused(limited, tmp_path, f"in{suffix}", f"in{suffix}", megabytes=60)


def test_a_laz_whose_table_asks_for_all_memory(limited, tmp_path):
    data = bytearray(cloud_bytes(Cloud(POINTS), ".laz"))
    start = int.from_bytes(data[96:100], "little")
    table = int.from_bytes(data[start : start + 8], "little")
    data[table + 4 : table + 8] = b"\xff" * 4
    (tmp_path / "in.laz").write_bytes(data)
    refused(limited, tmp_path, "in.laz", "its compressed points are damaged", megabytes=60)


def test_a_file_that_grows_while_it_is_read(tmp_path, monkeypatch):
    path = tmp_path / "in.xyz"
    path.write_bytes(b"1 2 3\n" * 400_000)

    def grow(head, suffix, name):
        with path.open("ab") as file:
            file.write(b"4 5 6\n")

    monkeypatch.setattr("pcsr.clouds.formats.reading.check_start", grow)
    with pytest.raises(UserError, match="grew while it was read"):
        read_cloud(path)
    monkeypatch.setattr("pcsr.clouds.formats.reading.check_start", lambda head, suffix, name: os.truncate(path, 10))
    with pytest.raises(UserError, match="shrank to 10 bytes while it was read"):
        read_cloud(path)


def test_files_that_may_not_be_read(limited, tmp_path):
    (tmp_path / "in.ply").write_bytes(cloud_bytes(Cloud(POINTS), ".ply"))
    (tmp_path / "in.ply").chmod(0)
    if os.access(tmp_path / "in.ply", os.R_OK):
        pytest.skip("this user may read everything")
    refused(limited, tmp_path, "in.ply", "in.ply", "Permission denied")


@pytest.mark.parametrize("size", [1e300, 1e-300, 1e150, 1e-150])
def test_coordinates_of_any_size_are_made_dense(limited, tmp_path, size):
    np.savetxt(tmp_path / "in.xyz", POINTS * size)
    np.savetxt(tmp_path / "usual.xyz", POINTS)
    for name in ("in", "usual"):
        outcome = limited(
            "upsample", f"{name}.xyz", "-o", f"{name}.npy", "--model", "midpoint", "--quiet", folder=tmp_path
        )
        assert (outcome.code, outcome.err) == (0, "")
    made, usual = (np.load(tmp_path / f"{name}.npy") for name in ("in", "usual"))
    assert np.abs(made / size - usual).max() < 1e-6
