"""`pcsr upsample --stream`, run as a person would run it."""

import numpy as np
import pytest
from click.testing import CliRunner

from pcsr.cli import pcsr, streaming
from pcsr.clouds.formats import read_cloud, write_cloud
from tests.streaming.clouds import sheet, use_small_patches


def run(*arguments):
    return CliRunner().invoke(pcsr, ["upsample", *map(str, arguments), "--model", "midpoint"])


@pytest.fixture
def scan(tmp_path, monkeypatch):
    use_small_patches(monkeypatch)
    write_cloud(tmp_path / "scan.ply", sheet(400))
    return tmp_path / "scan.ply"


def test_a_cloud_goes_from_disk_to_disk_and_the_progress_is_shown(scan, tmp_path):
    done = run(scan, "-o", tmp_path / "out.las", "--stream", "--rate", 2, "--fields", "source", "--jobs", 1)
    assert done.exit_code == 0, done.output
    for line in (
        "sorting: 1200 of 1200",
        "upsampling: 400 of 400",
        "writing: 800 of 800",
        "400 points to 800 by midpoint",
    ):
        assert line in done.output
    dense = read_cloud(tmp_path / "out.las")
    np.testing.assert_array_equal(dense.columns["source"], np.repeat([0, 1], 400))


@pytest.mark.parametrize("suffix", [".ply", ".npy", ".las", ".laz"])
def test_expected_errors_of_a_cloud_that_is_one_part_are_those_in_memory(tmp_path, suffix):
    write_cloud(tmp_path / "scan.ply", sheet(400))
    columns = []
    for name, option in ("whole", "--no-stream"), ("parts", "--stream"):
        out = tmp_path / f"{name}{suffix}"
        done = run(tmp_path / "scan.ply", "-o", out, option, "--rate", 2, "--fields", "error", "--jobs", 1)
        assert done.exit_code == 0, done.output
        columns.append(list(read_cloud(out).columns.values())[-1])
    np.testing.assert_allclose(*columns, rtol=1e-5)
    assert (columns[0][:400] == 0).all()
    assert 0 < columns[0][400:].min() <= columns[0][400:].max() < 1


def test_quiet_prints_nothing(scan, tmp_path):
    done = run(scan, "-o", tmp_path / "out.ply", "--stream", "--rate", 2, "--quiet", "--jobs", 1)
    assert (done.exit_code, done.output) == (0, "")


def test_large_clouds_are_streamed_unless_it_is_refused(scan, tmp_path, monkeypatch):
    monkeypatch.setattr(streaming, "MOST_IN_MEMORY", 399)
    assert "sorting" in run(scan, "-o", tmp_path / "a.ply", "--rate", 2, "--jobs", 1).output
    assert "sorting" not in run(scan, "-o", tmp_path / "b.ply", "--rate", 2, "--jobs", 1, "--no-stream").output
    assert "sorting" not in run(scan, "-o", tmp_path / "c.csv", "--rate", 2, "--jobs", 1).output
    monkeypatch.setattr(streaming, "MOST_IN_MEMORY", 400)
    assert "sorting" not in run(scan, "-o", tmp_path / "d.ply", "--rate", 2, "--jobs", 1).output


def test_warnings_are_shown_when_they_arise(scan, tmp_path):
    cloud = read_cloud(scan)
    cloud.points[7] = cloud.points[3]
    write_cloud(scan, cloud)
    done = run(scan, "-o", tmp_path / "out.ply", "--stream", "--rate", 2, "--jobs", 1)
    remark = "1 of 400 points is a copy of another, such as point 7, counted from 0: each position is used once"
    assert done.output.index(remark) < done.output.index("upsampling: ")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["scan.ply", "-o", "out.xyz"], "out.xyz cannot be written in parts: name a .ply, .npy, .las, .laz file"),
        (["scan.xyz", "-o", "out.ply"], "scan.xyz: a .xyz file cannot be read in parts: convert it to LAS, LAZ,"),
        (["-", "-o", "out.ply"], "IN is a pipe, which can be read only once: name a file"),
        (["scan.ply", "-o", "-"], "OUT is a pipe, which cannot be continued after an interruption: name a file"),
        (["scan.ply", "-o", "out.ply", "--denoise", "0.1"], "--denoise needs the whole cloud in memory: leave one"),
        (["scan.xyz", "-o", "out.ply", "--columns", "x,y,z"], "--columns is for text, which cannot be read in parts"),
    ],
)
def test_what_cannot_be_streamed_is_refused_in_one_line(scan, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    write_cloud(tmp_path / "scan.xyz", sheet(50))
    done = run(*arguments, "--stream")
    assert done.exit_code == 2
    assert message in done.output
    assert done.output.count("\n") == 1


def test_text_that_does_not_fit_into_memory_is_refused_with_the_remedy(tmp_path, monkeypatch):
    monkeypatch.setattr("pcsr.limits.UNCHECKED_SIZE", 1000)
    monkeypatch.setattr("pcsr.limits.free_memory", lambda: 2000)
    write_cloud(tmp_path / "scan.xyz", sheet(400))
    done = run(tmp_path / "scan.xyz", "-o", tmp_path / "out.ply")
    assert done.exit_code == 2
    assert "convert it to LAS, LAZ, binary PLY or NPY, which `pcsr upsample` reads in parts" in done.output
