"""Sick clouds as people have them, made dense by the command: nothing is made at invalid pixels, copies or strays."""

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial import cKDTree

from pcsr.cli import pcsr
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import read_cloud, write_cloud

SIDE = 16


def depth_image(seed=0):
    """The points of a depth camera before a wavy wall, row by row."""
    v, u = np.mgrid[0:SIDE, 0:SIDE].reshape(2, -1) / SIDE - 0.5
    z = 1 + 0.2 * np.sin(4 * u) * np.cos(3 * v) + np.random.default_rng(seed).normal(0, 1e-3, SIDE**2)
    return np.column_stack([u * z, v * z, z]).astype(np.float32).astype(np.float64)


def invalid(value, share=0.3):
    """The image, a share of whose pixels have a value instead, and which."""
    points = depth_image()
    rows = np.random.default_rng(1).random(len(points)) < share
    points[rows] = value
    return points, rows


def run(*arguments, code=0):
    done = CliRunner().invoke(pcsr, [str(argument) for argument in arguments])
    assert done.exit_code == code, done.output
    return done.output


def upsample(folder, points, *options, suffix=".ply", code=0):
    """Write points, make them dense by interpolation, and return what was said and the result."""
    write_cloud(folder / f"in{suffix}", Cloud(points, {"row": np.arange(len(points), dtype=np.int32)}), bad="keep")
    said = run(
        *("upsample", folder / f"in{suffix}", "-o", folder / f"out{suffix}", "--model", "midpoint", *options), code=code
    )
    if code:
        assert not (folder / f"out{suffix}").exists()
        assert len(said.strip().splitlines()) == 1
        return said, np.zeros((0, 3))
    return said, read_cloud(folder / f"out{suffix}", bad="keep").points


VALUES = {
    "zeros": ([0, 0, 0], "have the coordinates (0, 0, 0), which mark an invalid pixel"),
    "minus ones": ([-1, -1, -1], "have the coordinates (-1, -1, -1), which mark an invalid pixel"),
    "nan": ([np.nan] * 3, "have a coordinate that is not finite"),
    "depth nan": ([0, 0, np.nan], "have a coordinate that is not finite"),
    "largest": ([float(np.finfo(np.float32).max)] * 3, "have x = 3.402823e+38, which marks a missing measurement"),
}


@pytest.mark.parametrize(("name", "suffix"), [*((name, ".ply") for name in VALUES), ("zeros", ".xyz"), ("nan", ".xyz")])
def test_invalid_pixels_are_counted_and_get_no_new_points(tmp_path, name, suffix):
    value, what = VALUES[name]
    points, rows = invalid(value)
    healthy, count = points[~rows], int(rows.sum())
    sentence = f"{count} of {len(points)} points {what}, such as point {rows.argmax()}, counted from 0"
    refused, _ = upsample(tmp_path, points, suffix=suffix, code=2)
    assert sentence in refused
    assert "--bad drop" in refused
    said, dropped = upsample(tmp_path, points, "--bad", "drop", suffix=suffix)
    assert sentence in said
    assert len(dropped) == 4 * len(healthy)
    np.testing.assert_array_equal(dropped[: len(healthy)], healthy)
    assert cKDTree(depth_image()).query(dropped)[0].max() < 3 / SIDE
    said, kept = upsample(tmp_path, points, "--bad", "keep", suffix=suffix)
    assert sentence in said
    np.testing.assert_array_equal(kept[: len(points)], points)
    np.testing.assert_array_equal(kept[len(points) :], dropped[len(healthy) :])


def test_copies_are_counted_and_multiply_nothing(tmp_path):
    points = depth_image()
    copied = np.repeat(points, 8, axis=0)
    said, dense = upsample(tmp_path, copied)
    assert f"{7 * len(points)} of {8 * len(points)} points are exact copies of others" in said
    assert "each position is used once" in said
    np.testing.assert_array_equal(dense[: len(copied)], copied)
    new = dense[len(copied) :]
    np.testing.assert_array_equal(new, upsample(tmp_path, points)[1][len(points) :])
    assert cKDTree(points).query(new)[0].min() > 0
    assert len(upsample(tmp_path, copied, "--bad", "drop")[1]) == 4 * len(points)


def test_copies_in_the_last_bit_multiply_nothing(tmp_path):
    points = depth_image()
    moved = np.nextafter(points.astype(np.float32), np.float32(9)).astype(np.float64)
    said, dense = upsample(tmp_path, np.concatenate([points, moved]), "--bad", "drop")
    assert f"{len(points)} of {2 * len(points)} points are copies of others but for rounding" in said
    assert "the copies were dropped" in said
    np.testing.assert_array_equal(dense, upsample(tmp_path, points)[1])


@pytest.mark.parametrize("stray", [[1e10, 1e10, 1e10], [0, 1e6, 0], [0, 0, -100]])
@pytest.mark.parametrize("count", [1, 2])
def test_a_stray_is_said_and_the_rest_is_as_without_it(tmp_path, stray, count):
    points = depth_image()
    sick = np.concatenate([points[:7], [stray] * count, points[7:]])
    assert f"{count} of {len(sick)} points" in upsample(tmp_path, sick, code=2)[0]
    said, dense = upsample(tmp_path, sick, "--bad", "drop")
    assert "such as point 7, counted from 0" in said
    np.testing.assert_array_equal(dense, upsample(tmp_path, points)[1])


def test_an_organised_cloud_with_holes_is_one_line(tmp_path):
    points, rows = invalid([np.nan] * 3)
    pytest.importorskip("pypcd4")
    fields = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
    size = f"WIDTH {SIDE}\nHEIGHT {SIDE}\nPOINTS {SIDE**2}\nDATA ascii\n"
    body = "\n".join(" ".join(map(repr, point)) for point in points.tolist())
    (tmp_path / "in.pcd").write_text(fields + size + body + "\n")
    command = "upsample", tmp_path / "in.pcd", "-o", tmp_path / "out.pcd", "--model", "midpoint", "--bad"
    said = run(*command, "drop")
    assert said.count("not finite") == 1
    assert f"{rows.sum()} of {SIDE**2} points have a coordinate that is not finite" in said
    assert len(read_cloud(tmp_path / "out.pcd")) == 4 * (~rows).sum()
    run(*command, "keep")
    kept = read_cloud(tmp_path / "out.pcd", bad="keep").points
    np.testing.assert_array_equal(kept[: SIDE**2], points)
    assert np.isfinite(kept[SIDE**2 :]).all()


@pytest.mark.parametrize("suffix", [".obj", ".las"])
def test_a_format_without_such_numbers_is_said_before_the_work(tmp_path, suffix):
    if suffix == ".las":
        pytest.importorskip("laspy")
    np.save(tmp_path / "in.npy", invalid([np.nan] * 3)[0])
    command = "upsample", tmp_path / "in.npy", "-o", tmp_path / f"out{suffix}", "--model", "midpoint", "--bad", "keep"
    said = run(*command, code=2)
    assert f"out{suffix}: {suffix} holds no coordinates that are not finite" in said
    assert "--bad drop" in said
    assert "upsampling" not in said


def test_quiet_keeps_the_refusal_and_leaves_out_the_rest(tmp_path):
    np.save(tmp_path / "in.npy", invalid([0, 0, 0])[0])
    command = "upsample", tmp_path / "in.npy", "-o", tmp_path / "out.npy", "--model", "midpoint", "--quiet"
    assert "(0, 0, 0)" in run(*command, code=2)
    assert run(*command, "--bad", "drop") == ""


@pytest.mark.filterwarnings("always::pcsr.PcsrWarning")
def test_measuring_says_the_faults_and_different_units(tmp_path):
    points = depth_image()
    for name, cloud in (("a", points), ("mm", points * 1000), ("sick", invalid([0, 0, 0])[0])):
        write_cloud(tmp_path / f"{name}.xyz", Cloud(cloud))
    said = run("evaluate", tmp_path / "mm.xyz", tmp_path / "a.xyz", "--metric", "cd")
    assert "the prediction is 1,000 times as large as the truth" in said
    said = run("evaluate", tmp_path / "sick.xyz", tmp_path / "a.xyz", "--metric", "cd")
    assert "the prediction: " in said
    assert "points have the coordinates (0, 0, 0)" in said
    assert "warning" not in run("evaluate", tmp_path / "a.xyz", tmp_path / "a.xyz", "--metric", "cd")
