"""`pcsr upsample --denoise`, run as a person would run it."""

import numpy as np
import pytest
from click.testing import CliRunner

import pcsr
from pcsr.cli import pcsr as command
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import read_cloud, write_cloud


def run(*arguments):
    return CliRunner().invoke(command, ["upsample", *map(str, arguments), "--model", "midpoint"])


def floor(noise=0.2, count=400):
    rng = np.random.default_rng(0)
    across = rng.uniform(0, np.sqrt(count), (count, 2))
    return np.column_stack([across, noise * rng.normal(size=count)])


@pytest.fixture
def scan(tmp_path):
    write_cloud(tmp_path / "scan.ply", Cloud(floor(), {"label": np.arange(400, dtype=np.int32)}))
    return tmp_path / "scan.ply"


def test_the_level_is_estimated_and_said(scan, tmp_path):
    done = run(scan, "--denoise", "-o", tmp_path / "out.ply", "--rate", 2)
    assert done.exit_code == 0, done.output
    assert "estimated; 400 points moved by 0." in done.stderr
    dense, given = read_cloud(tmp_path / "out.ply"), read_cloud(scan)
    assert len(dense) == 800
    assert dense.points[:400, 2].std() < 0.5 * given.points[:, 2].std()
    np.testing.assert_array_equal(dense.columns["label"][:400], given.columns["label"])


@pytest.mark.parametrize("more", [(), ("--replace",), ("--fields", "source")])
def test_a_level_can_be_given_and_the_result_is_that_of_python(scan, tmp_path, more):
    done = run(scan, "-o", tmp_path / "out.ply", "--denoise", "0.2", "--rate", 2, *more)
    assert done.exit_code == 0, done.output
    assert "noise of 0.2 given; 400 points moved by 0." in done.stderr
    dense = pcsr.load("midpoint").upsample(
        read_cloud(scan), rate=2, denoise=0.2, keep="--replace" not in more, fields=more[1:]
    )
    write_cloud(tmp_path / "python.ply", dense)
    assert (tmp_path / "python.ply").read_bytes() == (tmp_path / "out.ply").read_bytes()


def test_without_noise_nothing_moves_and_that_is_said(tmp_path):
    np.save(tmp_path / "in.npy", floor(0.0))
    done = run(tmp_path / "in.npy", "-o", tmp_path / "out.npy", "--denoise")
    assert done.exit_code == 0, done.output
    assert "no noise is found that differs from details: no point is moved" in done.stderr
    np.testing.assert_array_equal(np.load(tmp_path / "out.npy")[:400], floor(0.0))


def test_quiet_says_nothing(scan, tmp_path):
    assert run(scan, "-o", tmp_path / "out.ply", "--denoise", "--quiet").output == ""


@pytest.mark.parametrize("level", ["-1", "-.5", "0", "nan", "inf", "-inf", "0,003", "1000", ""])
@pytest.mark.parametrize("joined", [True, False])
def test_a_level_that_is_none_is_one_line_with_the_remedy(scan, tmp_path, level, joined):
    option = [f"--denoise={level}"] if joined else ["--denoise", level]
    done = run(scan, "-o", tmp_path / "out.ply", *option)
    assert done.exit_code == 2
    assert "--denoise" in done.output
    assert "standard deviation of the noise" in done.output
    assert len(done.output.strip().splitlines()) == 1
    assert not (tmp_path / "out.ply").exists()


@pytest.mark.parametrize("name", ["scan.ply", "-"])
def test_a_cloud_after_the_option_is_refused_with_the_right_order(tmp_path, name):
    done = run("--denoise", name, "-o", tmp_path / "out.ply")
    assert done.exit_code == 2
    assert f"--denoise '{name}'" in done.output
    assert "put it before --denoise" in done.output
    assert len(done.output.strip().splitlines()) == 1
