"""Formats that people have, from the file to the command's output: the right coordinates, colours and notes."""

import json
import struct
import subprocess
import sys

import numpy as np
import pytest
from click.testing import CliRunner

from pcsr.cli import pcsr
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes, read_cloud, write_cloud, write_points
from tests.clouds.reading import read_cloud_bytes

pytestmark = pytest.mark.filterwarnings("default::pcsr.PcsrWarning")
RNG = np.random.default_rng(0)
POINTS = np.column_stack([RNG.uniform(-1, 1, (60, 2)), np.zeros(60)]).astype("f4").astype("f8")


def run(*arguments, **options):
    return CliRunner().invoke(pcsr, [str(argument) for argument in arguments], **options)


def upsampled(source, *options, out="out.ply"):
    """The dense cloud of a file and what the command printed."""
    target = source.parent / out
    done = run("upsample", source, "-o", target, "--model", "midpoint", *options)
    assert done.exit_code == 0, done.output
    return read_cloud(target), " ".join(done.output.split())


def test_kitti_and_nuscenes_by_their_names(tmp_path):
    rows = np.column_stack([POINTS, np.linspace(0, 1, 60), np.arange(60) % 32]).astype("<f4")
    for kind, width in (("kitti", 4), ("nuscenes", 5)):
        path = tmp_path / f"{kind}.bin"
        path.write_bytes(rows[:, :width].tobytes())
        dense, _ = upsampled(path, "--format", kind)
        np.testing.assert_array_equal(dense.points[:60], POINTS)
        assert list(dense.columns) == ["intensity", "ring"][: width - 3]
        bare = run("upsample", path, "-o", tmp_path / "out.ply")
        assert bare.exit_code == 2
        assert all(f"--format {name}" in bare.output for name in ("kitti", "nuscenes", "colmap"))
        path.write_bytes(rows[:, :width].tobytes()[:-3])
        assert "are no multiple of" in run("upsample", path, "-o", tmp_path / "o.ply", "--format", kind).output


def test_evaluate_takes_a_format_for_suffixes_that_name_none(tmp_path):
    write_cloud(tmp_path / "a.ply", Cloud(POINTS))
    rows = np.column_stack([POINTS * 1.5, np.zeros(60)])
    (tmp_path / "scan.bin").write_bytes(rows.astype("<f4").tobytes())
    for pair in (("scan.bin", "a.ply"), ("scan.bin", "scan.bin")):
        paths = [tmp_path / name for name in pair]
        done = run("evaluate", *paths, "--format", "kitti", "--metric", "hd", "--frame", "none", "--json")
        assert done.exit_code == 0, done.output
        assert (json.loads(done.stdout)["hd"] > 0.1) == (pair[0] != pair[1])
        assert "--format kitti" in run("evaluate", *paths).output
    unused = run("evaluate", tmp_path / "a.ply", tmp_path / "a.ply", "--format", "kitti")
    assert unused.exit_code == 2
    assert "--format kitti: the suffixes of both clouds name their formats" in unused.output


def test_the_points_of_colmap(tmp_path):
    data = struct.pack("<Q", 60)
    for number, point in enumerate(POINTS):
        data += struct.pack("<Q3d3BdQ2I", 100 + number, *point, 255, 0, 7, 0.5, 1, 3, 4)
    (tmp_path / "points3D.bin").write_bytes(data)
    dense, said = upsampled(tmp_path / "points3D.bin")
    np.testing.assert_array_equal(dense.points[:60], POINTS)
    assert {tuple(dense.columns[name][0] for name in ("red", "green", "blue"))} == {(255, 0, 7)}
    assert "points3D.bin: the tracks of its points" in said


def test_a_format_is_obeyed_whatever_the_suffix(tmp_path):
    (tmp_path / "scan.dat").write_bytes(cloud_bytes(Cloud(POINTS), ".xyz"))
    dense, _ = upsampled(tmp_path / "scan.dat", "--format", "xyz")
    np.testing.assert_array_equal(dense.points[:60], POINTS)
    write_cloud(tmp_path / "scan.ply", Cloud(POINTS))
    wrong = run("upsample", tmp_path / "scan.ply", "-o", tmp_path / "o.ply", "--format", "xyz")
    assert wrong.exit_code == 2
    assert "is a .ply file by its content" in wrong.output
    rows = np.column_stack([POINTS, np.zeros(60)]).astype("<f4").tobytes()
    for suffix, given, written in (("xyz", cloud_bytes(Cloud(POINTS), ".xyz"), ".xyz"), ("kitti", rows, ".ply")):
        command = [sys.executable, "-m", "pcsr.cli", "upsample", "-", "-o", "-", "--model", "midpoint"]
        command += ["--format", suffix]
        piped = subprocess.run(command, input=given, capture_output=True, check=False)
        assert piped.returncode == 0, piped.stderr
        dense = read_cloud_bytes(piped.stdout, written)
        np.testing.assert_array_equal(dense.points[:60], POINTS)


def test_gaussian_splats(tmp_path):
    names = ["f_dc_0", "f_dc_1", "f_dc_2", "f_rest_0", "opacity", "scale_0", "rot_0", "rot_1", "rot_2", "rot_3"]
    columns = {name: np.full(60, 10.0 if name == "f_dc_0" else 0.0, "f4") for name in names}
    write_cloud(tmp_path / "splats.ply", Cloud(POINTS, columns, {"ply": {"coordinates": "float"}}))
    dense, said = upsampled(tmp_path / "splats.ply")
    assert list(dense.columns) == ["red", "green", "blue"]
    assert {(255, 128, 128)} == set(zip(*(dense.columns[name].tolist() for name in dense.columns), strict=True))
    assert said.count("Gaussian splats") == 1


def test_colours_of_other_formats_are_bytes_in_a_ply(tmp_path):
    for suffix, kind, most in ((".obj", "f8", 1), (".npz", "u2", 65535), (".las", "u2", 65535)):
        colours = {name: np.full(60, most, kind) for name in ("red", "green", "blue")}
        write_cloud(tmp_path / f"a{suffix}", Cloud(POINTS, colours))
        dense, _ = upsampled(tmp_path / f"a{suffix}")
        assert dense.columns["red"].dtype == np.uint8
        assert set(dense.columns["red"].tolist()) == {255}


def test_pcd_of_old_versions_and_what_pcl_reads(tmp_path):
    rows = "".join(f"{x:.6f} {y:.6f} {z:.6f} {i}\n" for i, (x, y, z) in enumerate(POINTS))
    head = "VERSION .5\nFIELDS X Y Z label\nSIZE 4 4 4 1\nTYPE f f f u\nWIDTH 60\nHEIGHT 1\nPOINTS 60\nDATA ascii\n"
    (tmp_path / "old.pcd").write_text(head + rows)
    dense, _ = upsampled(tmp_path / "old.pcd", out="out.pcd")
    np.testing.assert_allclose(dense.points[:60], POINTS, atol=1e-6)
    assert dense.columns["label"][:60].tolist() == list(range(60))
    assert b"SIZE 4 4 4 1\n" in (tmp_path / "out.pcd").read_bytes()


def test_lists_of_a_vertex_are_left_out_with_a_word(tmp_path):
    lines = "".join(f"property float {axis}\n" for axis in "xyz") + "property list uchar int view\n"
    rows = [" ".join(map(str, [*point, i % 3, *range(i % 3)])) for i, point in enumerate(POINTS)]
    head = f"ply\nformat ascii 1.0\nelement vertex 60\n{lines}end_header\n"
    (tmp_path / "views.ply").write_text(head + "\n".join(rows))
    dense, said = upsampled(tmp_path / "views.ply")
    np.testing.assert_allclose(dense.points[:60], POINTS)
    assert dense.columns == {}
    assert "views.ply: the lists 'view' of its 60 points have different lengths and were left out" in said


def test_what_cannot_be_written_is_refused_before_the_work(tmp_path):
    write_cloud(tmp_path / "a.npz", Cloud(POINTS, {"label": np.zeros(60)}))
    for out, reason in (("out.obj", "an .obj holds points"), ("out.copc.laz", "COPC cannot be written")):
        done = run("upsample", tmp_path / "a.npz", "-o", tmp_path / out)
        assert (done.exit_code, reason in done.output) == (2, True)
        assert "upsampling" not in done.output
        assert not (tmp_path / out).exists()


def test_evaluate_reads_what_upsample_writes_and_tells_units_apart(tmp_path):
    from pcsr.clouds.formats import CLOUD_WRITERS

    for suffix in CLOUD_WRITERS:
        write_cloud(tmp_path / f"a{suffix}", Cloud(POINTS))
        done = run("evaluate", tmp_path / f"a{suffix}", tmp_path / "a.ply", "--metric", "cd")
        assert done.exit_code == 0, done.output
        assert "units" not in done.output
    write_points(tmp_path / "mm.xyz", POINTS * 1000)
    done = run("evaluate", tmp_path / "mm.xyz", tmp_path / "a.ply", "--metric", "cd")
    assert done.exit_code == 0
    assert "the prediction is 1,000 times as large as the truth: if their units differ" in done.output
