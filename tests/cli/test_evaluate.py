"""`pcsr evaluate`, run as a person would run it."""

import json

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from pcsr import evaluate
from pcsr.cli import pcsr
from pcsr.clouds.formats import write_points


def run(*arguments):
    return CliRunner().invoke(pcsr, [str(argument) for argument in arguments])


def test_it_prints_every_metric_with_its_convention(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=2)
    ball.export(tmp_path / "mesh.stl")
    write_points(tmp_path / "truth.ply", ball.vertices)
    write_points(tmp_path / "made.ply", ball.vertices * 1.01)
    done = run("evaluate", tmp_path / "made.ply", tmp_path / "truth.ply", "--mesh", tmp_path / "mesh.stl")
    assert done.exit_code == 0, done.output
    assert all(name in done.output for name in ("cd", "hd", "hd-pugcn", "emd", "p2f", "×10⁻³"))
    assert "normalised by the bounding sphere of the truth" in " ".join(done.output.split())
    plain = run(
        "evaluate", tmp_path / "made.ply", tmp_path / "truth.ply", "--json", "--metric", "cd", "--frame", "none"
    )
    assert json.loads(plain.output)["cd"] == pytest.approx(2 * 0.01**2, rel=1e-3)
    wrong = run("evaluate", tmp_path / "made.ply", tmp_path / "none.ply")
    assert wrong.exit_code == 2
    assert "none.ply" in wrong.output


def test_columns_of_text_are_named(tmp_path):
    points = np.random.default_rng(0).normal(size=(40, 3))
    write_points(tmp_path / "a.ply", points)
    np.savetxt(tmp_path / "b.txt", np.column_stack([np.arange(40), points]), "%d %.17g %.17g %.17g")
    files = (tmp_path / "a.ply", tmp_path / "b.txt", "--json", "--metric", "cd")
    assert json.loads(run("evaluate", *files, "--columns", "-,x,y,z").output)["cd"] == 0
    wrong = run("evaluate", tmp_path / "a.ply", tmp_path / "a.ply", "--columns", "-,x,y,z")
    assert wrong.exit_code == 2
    assert "neither cloud is text" in wrong.output


def test_it_says_why_there_is_no_emd(tmp_path):
    write_points(tmp_path / "a.ply", np.random.default_rng(0).normal(size=(40, 3)))
    write_points(tmp_path / "b.ply", np.random.default_rng(1).normal(size=(30, 3)))
    done = run("evaluate", tmp_path / "a.ply", tmp_path / "b.ply")
    assert done.exit_code == 0
    assert (
        "skipped: emd compares clouds of the same size, got 40 and 30 points: subsample the larger one" in done.output
    )


@pytest.mark.parametrize("frame", ["truth", "each", "none"])
def test_it_measures_as_python_does_in_every_frame(tmp_path, frame):
    truth = np.random.default_rng(0).normal(size=(60, 3)) * 5
    made = 1.1 * truth + 0.01
    write_points(tmp_path / "truth.npy", truth)
    write_points(tmp_path / "made.npy", made)
    done = run("evaluate", tmp_path / "made.npy", tmp_path / "truth.npy", "--frame", frame, "--json")
    assert json.loads(done.output) == evaluate(made, truth, frame=frame)
    table = " ".join(run("evaluate", tmp_path / "made.npy", tmp_path / "truth.npy", "--frame", frame).output.split())
    captions = {
        "truth": "normalised by the bounding sphere of the truth",
        "each": "Each cloud is normalised",
        "none": "in the unit of the clouds",
    }
    assert captions[frame] in table
    assert "Lower is better." in table


@pytest.mark.parametrize(
    ("options", "said"),
    [(["--metric", "chamfer"], "chamfer"), (["--metric", "p2f"], "mesh"), (["--frame", "x"], "--frame")],
)
def test_what_cannot_be_measured_is_said(tmp_path, options, said):
    write_points(tmp_path / "a.npy", np.random.default_rng(0).normal(size=(20, 3)))
    done = run("evaluate", tmp_path / "a.npy", tmp_path / "a.npy", *options)
    assert done.exit_code == 2
    assert said in done.output
