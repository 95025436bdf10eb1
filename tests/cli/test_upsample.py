"""`pcsr upsample`, run as a person would run it."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from pcsr import Touch, load
from pcsr.cli import pcsr
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import read_cloud, read_points, write_cloud, write_points
from pcsr.recorded import write


def run(*arguments, **options):
    return CliRunner().invoke(pcsr, [str(argument) for argument in arguments], **options)


def bowl(count=80, seed=0):
    xy = np.random.default_rng(seed).uniform(-1, 1, (count, 2))
    return np.column_stack([xy, 0.3 * xy[:, 0] ** 2 + 0.1 * xy[:, 1]])


@pytest.fixture
def scan(tmp_path):
    """A coloured cloud at UTM coordinates, with normals, an intensity and a label."""
    points = bowl() + np.array([500_000.0, 5_400_000.0, 300.0])
    left = points[:, 0] < 500_000
    columns = {
        "red": np.where(left, 250, 10).astype(np.uint8),
        "green": np.full(80, 100, np.uint8),
        "blue": np.where(left, 0, 200).astype(np.uint8),
        "nx": np.zeros(80, np.float32),
        "ny": np.zeros(80, np.float32),
        "nz": np.ones(80, np.float32),
        "intensity": np.linspace(0, 1, 80).astype(np.float32),
        "label": np.where(left, 7, 3).astype(np.int32),
    }
    write_cloud(tmp_path / "scan.ply", Cloud(points, columns))
    return tmp_path / "scan.ply"


@pytest.mark.parametrize(("arguments", "count"), [([], 320), (["--rate", "2.5"], 200), (["--points", "123"], 123)])
def test_as_many_points_come_out_as_were_asked_for(scan, tmp_path, arguments, count):
    done = run("upsample", scan, "-o", tmp_path / "out.ply", *arguments)
    assert done.exit_code == 0, done.output
    assert f"80 points to {count} by field in " in done.output
    dense, given = read_cloud(tmp_path / "out.ply"), read_cloud(scan)
    assert len(dense) == count
    np.testing.assert_array_equal(dense.points[:80], given.points)


def test_the_command_writes_what_python_gives(scan, tmp_path):
    assert run("upsample", scan, "-o", tmp_path / "out.ply").exit_code == 0
    dense = load().upsample(read_cloud(scan))
    assert isinstance(dense, Cloud)
    write_cloud(tmp_path / "python.ply", dense)
    assert (tmp_path / "python.ply").read_bytes() == (tmp_path / "out.ply").read_bytes()


def test_colours_normals_and_labels_survive_and_so_do_millimetres(scan, tmp_path):
    assert run("upsample", scan, "-o", tmp_path / "out.ply", "--model", "midpoint").exit_code == 0
    dense, given = read_cloud(tmp_path / "out.ply"), read_cloud(scan)
    assert list(dense.columns) == list(given.columns)
    for name, column in given.columns.items():
        assert dense.columns[name].dtype == column.dtype
        np.testing.assert_array_equal(dense.columns[name][:80], column)
    assert set(dense.columns["label"]) == {3, 7}
    inner = dense.points[:, 0] < 500_000 - 0.5
    assert (dense.columns["red"][inner] > 200).all()
    assert (dense.columns["green"] == 100).all()
    normals = np.stack([dense.columns[name] for name in ("nx", "ny", "nz")], 1)
    np.testing.assert_allclose(normals, [[0, 0, 1]] * len(dense), atol=1e-6)
    local = dense.points - [500_000.0, 5_400_000.0, 300.0]
    surface = 0.3 * local[:, 0] ** 2 + 0.1 * local[:, 1]
    assert np.abs(local[:80, 2] - surface[:80]).max() < 1e-6
    assert np.abs(local[:, 2] - surface).max() < 0.1


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".xyz", ".txt", ".csv", ".npy", ".npz", ".las", ".laz"])
def test_every_format_goes_in_and_out(tmp_path, suffix):
    write_points(tmp_path / "in.xyz", bowl())
    first = run("upsample", tmp_path / "in.xyz", "-o", tmp_path / f"a{suffix}", "--rate", 2, "--model", "midpoint")
    assert first.exit_code == 0, first.output
    again = run("upsample", tmp_path / f"a{suffix}", "-o", tmp_path / "b.npy", "--rate", 2, "--model", "midpoint")
    assert again.exit_code == 0, again.output
    assert read_points(tmp_path / "b.npy").shape == (320, 3)


@pytest.mark.parametrize("suffix", [".ply", ".pcd", ".xyz", ".txt", ".csv", ".npy", ".npz", ".las", ".laz"])
def test_the_expected_error_is_a_column_of_every_format_that_has_columns(tmp_path, suffix):
    write_points(tmp_path / "in.xyz", bowl())
    fields = ("--fields", "source", "--fields", "error")
    done = run("upsample", tmp_path / "in.xyz", "-o", tmp_path / f"a{suffix}", "--model", "midpoint", *fields)
    assert done.exit_code == 0, done.output
    columns = read_cloud(tmp_path / f"a{suffix}").columns
    errors = columns["c4" if suffix == ".npy" else "error"]
    expected = load("midpoint").upsample(Cloud(bowl()), fields=["error"]).columns["error"]
    np.testing.assert_allclose(errors, expected, rtol=1e-4)


def test_with_denoise_the_given_points_have_half_of_the_noise_as_error(tmp_path):
    points = bowl(1500) + 0.03 * np.random.default_rng(1).normal(size=(1500, 3))
    write_points(tmp_path / "in.xyz", points)
    command = ("upsample", tmp_path / "in.xyz", "-o", tmp_path / "out.ply", "--model", "midpoint", "--rate", 2)
    done = run(*command, "--denoise", 0.03, "--fields", "error")
    assert done.exit_code == 0, done.output
    dense = read_cloud(tmp_path / "out.ply")
    np.testing.assert_allclose(dense.columns["error"][:1500], 0.015, rtol=1e-5)
    assert 0.003 < np.median(dense.columns["error"][1500:]) < 0.03


@pytest.mark.parametrize("suffix", [".obj", ".pts"])
def test_a_format_without_columns_is_refused_before_the_work(tmp_path, suffix):
    write_points(tmp_path / "in.xyz", bowl())
    done = run(
        "upsample", tmp_path / "in.xyz", "-o", tmp_path / f"a{suffix}", "--fields", "error", "--model", "nothing"
    )
    assert done.exit_code == 2
    assert "not the columns error: write a .ply" in done.output


@pytest.mark.parametrize("suffix", [".obj", ".stl", ".glb", ".off"])
def test_of_a_mesh_the_vertices_are_taken(tmp_path, suffix):
    ball = trimesh.creation.icosphere(subdivisions=2)
    ball.export(tmp_path / f"ball{suffix}")
    done = run("upsample", tmp_path / f"ball{suffix}", "-o", tmp_path / "out.ply", "--rate", 3, "--model", "midpoint")
    assert done.exit_code == 0, done.output
    assert len(read_points(tmp_path / "out.ply")) % 3 == 0


@pytest.mark.slow
def test_a_pipe_takes_and_gives_clouds(scan):
    command = [str(Path(sys.executable).with_name("pcsr")), "upsample", "-", "-o", "-", "--rate", "2"]
    done = subprocess.run([*command, "--model", "midpoint"], input=scan.read_bytes(), capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(b"ply")
    assert b"element vertex 160" in done.stdout[:200]
    assert b"80 points to 160" in done.stderr


def test_touches_are_used_and_those_of_no_use_are_said(scan, tmp_path):
    points = read_points(scan)
    surface = bowl(4000, 1) + np.array([500_000.0, 5_400_000.0, 300.0])
    away = np.linalg.norm(surface[:, None] - points[None], axis=2).min(1)
    middle = surface[np.argsort(away)[-200]]  # of a gap: elsewhere the points of the scan are kept instead
    patch = surface[np.linalg.norm(surface - middle, axis=1).argsort()[:40]]
    touches = [Touch.single(patch, np.diag([1e-3, 1e-3, 1e-3, 1.0]), 1000.0, "digit")] * 2
    write(tmp_path / "touches", touches)
    (tmp_path / "touches" / "1.ply").write_text("noise")
    command = ("upsample", scan, "--rate", 2)
    plain = run(*command, "-o", tmp_path / "plain.npy")
    done = run(*command, "-o", tmp_path / "out.npy", "--touch", tmp_path / "touches", "--touch-as-is")
    assert (plain.exit_code, done.exit_code) == (0, 0), done.output
    assert "touch 1.ply is skipped: " in done.output
    assert "80 points and 1 of 2 touches to 160 by field" in done.output
    assert not np.array_equal(read_points(tmp_path / "plain.npy"), read_points(tmp_path / "out.npy"))


@pytest.mark.slow
@pytest.mark.filterwarnings("always::pcsr.PcsrWarning")
def test_columns_of_text_are_guessed_aloud_or_given(tmp_path):
    rows = np.column_stack([np.arange(80), bowl(), np.full(80, 250), np.full((80, 2), 9)])
    np.savetxt(tmp_path / "scan.txt", rows, "%d %.6f %.6f %.6f %d %d %d")
    guessed = run("upsample", tmp_path / "scan.txt", "-o", tmp_path / "guessed.ply", "--model", "midpoint")
    assert guessed.exit_code == 0, guessed.output
    said = " ".join(guessed.output.split())
    assert "its first column holds integers and was taken for x" in said
    assert "its columns 5 to 7 were taken for colours" in said
    names = ("--columns", "-,x,y,z,red,green,blue")
    named = run("upsample", tmp_path / "scan.txt", "-o", tmp_path / "named.ply", "--model", "midpoint", *names)
    assert named.exit_code == 0, named.output
    assert "taken for" not in named.output
    dense = read_cloud(tmp_path / "named.ply")
    np.testing.assert_allclose(dense.points[:80], rows[:, 1:4], atol=1e-6)
    assert {name: column[0] for name, column in dense.columns.items()} == {"red": 250, "green": 9, "blue": 9}
    command = [Path(sys.executable).with_name("pcsr"), "upsample", "-", "-o", "-", "--model", "midpoint", *names]
    content = (tmp_path / "scan.txt").read_bytes()
    piped = subprocess.run([*map(str, command), "--format", "txt"], input=content, capture_output=True, check=False)
    assert piped.returncode == 0, piped.stderr
    assert piped.stdout.startswith(b"x y z red green blue\n")
    wrong = run("upsample", tmp_path / "named.ply", "-o", tmp_path / "b.ply", *names)
    assert wrong.exit_code == 2
    assert "--columns is for .asc, .csv, .pts, .txt, .xyz" in " ".join(wrong.output.split())


def test_points_that_are_not_finite_are_refused_or_dropped(tmp_path):
    points = bowl()
    points[3, 1] = np.nan
    points[5, 0] = np.inf
    np.save(tmp_path / "in.npy", points)
    refused = run("upsample", tmp_path / "in.npy", "-o", tmp_path / "out.npy", "--model", "midpoint")
    assert refused.exit_code == 2
    assert "2 of " in refused.output
    dropped = run("upsample", tmp_path / "in.npy", "-o", tmp_path / "out.npy", "--bad", "drop", "--model", "midpoint")
    assert dropped.exit_code == 0, dropped.output
    assert "2 of 80 points have a coordinate that is not finite, such as point 3, counted from 0" in dropped.output
    assert len(read_points(tmp_path / "out.npy")) == 4 * 78


@pytest.mark.parametrize(
    ("content", "name", "said"),
    [
        (b"", "in.ply", "in.ply"),
        (b"1 2 3\n4 5\n", "in.xyz", "line 2"),
        (b"1 2 3\n4 five 6\n", "in.xyz", "line 2"),
        (b"1 2 3\n" * 3, "in.ply", "in.ply"),
        (b"1 2 3\n2 3 4\n3 4 6\n", "in.xyz", "the cloud has 3 points: at least 16 are needed"),
        (b"1 2 3\n" * 20, "in.xyz", "lie on one spot"),
        (b"1 2 3\n", "in.doc", "'.doc'"),
    ],
)
def test_a_cloud_that_cannot_be_used_is_one_line_and_no_file(tmp_path, content, name, said):
    (tmp_path / name).write_bytes(content)
    done = run("upsample", tmp_path / name, "-o", tmp_path / "out.ply", "--model", "midpoint")
    assert done.exit_code == 2
    assert said in done.output
    assert len(done.output.strip().splitlines()) == 1
    assert not (tmp_path / "out.ply").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--rate", "0.5"], "rate is 0.5: it must be 1.1 to 64"),
        (["--rate", "2", "--points", "200"], "exclude each other"),
        (["--points", "40"], "40 points are fewer than the 80 of the cloud"),
        (["--model", "taspr"], "did you mean 'tapsr'"),
        (["--touch", "nowhere"], "nowhere"),
        (["--device", "cuda:9"], "--device cuda:9"),
    ],
)
def test_a_mistake_is_one_line_and_no_file(scan, tmp_path, arguments, said):
    done = run("upsample", scan, "-o", tmp_path / "out.ply", *arguments)
    assert done.exit_code == 2
    assert said in done.output
    assert len(done.output.strip().splitlines()) == 1
    assert not (tmp_path / "out.ply").exists()


def test_a_suffix_that_nobody_writes_is_said_before_the_work(scan, tmp_path):
    done = run("upsample", scan, "-o", tmp_path / "out.stl")
    assert done.exit_code == 2
    assert ".stl" in done.output


def test_a_file_in_single_precision_stays_one(tmp_path):
    trimesh.PointCloud(bowl()).export(tmp_path / "in.ply")
    assert run("upsample", tmp_path / "in.ply", "-o", tmp_path / "out.ply", "--model", "midpoint").exit_code == 0
    assert b"property float x" in (tmp_path / "out.ply").read_bytes()[:300]
    np.testing.assert_array_equal(read_points(tmp_path / "out.ply")[:80], read_points(tmp_path / "in.ply"))


def test_a_touch_that_is_left_out_is_told_even_to_who_wants_quiet(scan, tmp_path):
    write(tmp_path / "touches", [Touch.single(read_points(scan)[:40], None, 1000.0, "digit")] * 2)
    (tmp_path / "touches" / "1.ply").write_text("noise")
    command = ("upsample", scan, "-o", tmp_path / "out.ply", "--touch", tmp_path / "touches", "--model", "midpoint")
    done = run(*command, "--touch-as-is", "--quiet")
    assert done.exit_code == 0, done.output
    assert done.output.startswith("touch 1.ply is skipped: ")
    assert len(done.output.strip().splitlines()) == 1


@pytest.mark.parametrize("model", ["field", "midpoint"])
@pytest.mark.parametrize("touched", [False, True])
def test_the_command_and_python_give_the_same_bytes(tmp_path, model, touched):
    cloud, touches = bowl(), [Touch.single(bowl(400, 1)[:60], None, 1.0, "digit")] if touched else []
    np.save(tmp_path / "in.npy", cloud)
    write(tmp_path / "touches", touches or [Touch.single(cloud[:5], None, 1.0, "digit")])
    more = ["--touch", tmp_path / "touches", "--touch-as-is"] if touched else []
    done = run("upsample", tmp_path / "in.npy", "-o", tmp_path / "out.npy", "--model", model, "--rate", 3, *more)
    assert done.exit_code == 0, done.output
    dense = load(model).upsample(cloud, touches, rate=3, touch_as_is=True)
    assert dense.shape == (240, 3)
    np.save(tmp_path / "python.npy", dense)
    assert (tmp_path / "out.npy").read_bytes() == (tmp_path / "python.npy").read_bytes()
