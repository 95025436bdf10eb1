"""Registration of the touches of `pcsr upsample`: the table, the report, and the options, run as a person would."""

import json
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from pcsr import PoseError, load
from pcsr import touches as module
from pcsr.cli import pcsr
from pcsr.cli.registered import MOST_ROWS
from pcsr.clouds.formats import read_cloud, read_points, write_points
from pcsr.recorded import write
from tests.registration import by_hand

pytestmark = pytest.mark.filterwarnings("ignore:.*are added to it as unseen surface")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    write_points(tmp_path / "scan.ply", by_hand.scan(400))
    write(tmp_path / "touches", by_hand.touches(), by_hand.NAMES, pose_error=PoseError(0.3, 0.2))
    monkeypatch.chdir(tmp_path)
    return tmp_path


def upsample(*more, touches="touches", out="out.npy"):
    words = ["upsample", "scan.ply", "-o", out, "--model", "midpoint", "--rate", "2", *more]
    return CliRunner().invoke(pcsr, [*words, "--touch", touches] if touches else words)


STREAMED = pytest.mark.parametrize("options", [[], ["--stream"]])


@STREAMED
def test_a_table_says_what_became_of_the_touches(folder, made_by_hand, options):
    done = upsample("--touch-report", "report.json", *options)
    assert done.exit_code == 0, done.output
    assert done.stdout == ""
    rows = [line.split() for line in done.stderr.splitlines()]
    assert ["left", "moved", "0.40", "0.00", "30", "0.05", "by", "its", "surface"] in rows
    assert done.stderr.count("touch [red]below is refused: it fits nowhere\n") == 1
    assert "refused and not used" not in done.stderr
    assert "400 points and 2 of 3 touches to 800 by midpoint" in done.stderr
    plain = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    assert [one["verdict"] for one in plain["touches"]] == ["kept", "moved", "refused"]
    assert made_by_hand == [PoseError(0.3, 0.2)]


def test_the_touches_are_used_as_in_python(folder, made_by_hand):
    assert upsample().exit_code == 0
    dense = load("midpoint").upsample(read_points(folder / "scan.ply"), by_hand.registration(by_hand.touches()), rate=2)
    np.testing.assert_array_equal(read_points(folder / "out.npy"), dense)


@STREAMED
def test_touches_as_they_are_give_what_arrays_give(folder, monkeypatch, options):
    monkeypatch.setattr(module, "register", None)
    done = upsample("--touch-as-is", *options)
    assert done.exit_code == 0, done.output
    assert "verdict" not in done.output
    if not options:
        arrays = [one.points for one in by_hand.touches()]
        dense = load("midpoint").upsample(read_points(folder / "scan.ply"), arrays, rate=2)
        np.testing.assert_array_equal(read_points(folder / "out.npy"), dense)


@STREAMED
def test_exact_poses_give_the_bytes_of_touches_as_they_are(folder, options):
    assert upsample("--touch-as-is", *options, out="trusted.npy").exit_code == 0
    assert upsample("--pose-error", "0,0", *options).exit_code == 0
    assert (folder / "out.npy").read_bytes() == (folder / "trusted.npy").read_bytes()


@STREAMED
def test_touched_points_have_the_error_of_their_registration_in_the_column(folder, made_by_hand, options):
    scan = by_hand.scan(1500)
    write_points(folder / "scan.ply", scan[np.linalg.norm(scan[:, :2] - (20, 5), axis=1) > 12])  # a hole at a touch
    done = upsample("--fields", "source", "--fields", "error", *options, out="out.ply")
    assert done.exit_code == 0, done.output
    columns = read_cloud(folder / "out.ply").columns
    touched = columns["source"] == 2
    assert touched.sum() > 3
    np.testing.assert_allclose(columns["error"][touched], 0.05, rtol=1e-6)
    assert np.isfinite(columns["error"]).all()


def test_the_error_of_the_command_is_taken_instead_of_the_recordings(folder, made_by_hand):
    assert upsample("--pose-error", "2, 1.5").exit_code == 0
    assert made_by_hand == [PoseError(2.0, 1.5)]


def test_quiet_names_refused_touches_alone(folder, made_by_hand):
    assert upsample("--quiet").stderr == "touch [red]below is refused: it fits nowhere\n"


def test_a_long_table_ends_with_a_count(folder, made_by_hand):
    first, second, third = by_hand.touches()
    write(folder / "touches", [first, second, *[third] * 30], overwrite=True)
    done = upsample()
    assert done.exit_code == 0, done.output
    assert done.stderr.count(" refused ") == MOST_ROWS - 2
    assert "and 12 more touches" in done.stderr
    assert done.stderr.count("is refused: it fits nowhere") == 30
    assert "400 points and 2 of 32 touches" in done.stderr


@pytest.mark.parametrize(
    ("more", "touches", "said"),
    [
        (["--pose-error", "1,2"], None, "--pose-error: it is about the touches of --touch, which is not given"),
        (["--touch-as-is"], None, "--touch-as-is: it is about the touches of --touch"),
        (["--touch-report", "r.json"], None, "--touch-report: it is about the touches of --touch"),
        (
            ["--touch-as-is", "--pose-error", "1,2"],
            "touches",
            "--pose-error: with --touch-as-is no touch is registered",
        ),
        (["--touch-as-is", "--touch-report", "r.json"], "touches", "--touch-report: with --touch-as-is no touch"),
        (["--pose-error", "a,b"], "touches", "--pose-error 'a,b': it must be two numbers"),
        (["--pose-error", "1,2,3"], "touches", "--pose-error '1,2,3': it must be two numbers"),
        (["--pose-error=-1,2"], "touches", "--pose-error -1,2: pose error: position is -1 mm: it must be 0 to 100"),
        (["--pose-error", "1,nan"], "touches", "rotation is nan degrees: it must be 0 to 45"),
        (["--touch-report", "touches"], "touches", "touches is a folder"),
        (["--touch-report", "scan.ply"], "touches", "--touch-report scan.ply: this command reads or writes that file"),
        (["--touch-report", "./out.npy"], "touches", "--touch-report out.npy: this command reads or writes that file"),
        (["--touch-report", "touches/0.ply"], "touches", "--touch-report touches/0.ply: it may be a file of the rec"),
        (["--touch-report", "touches/touches.json"], "touches", "touches.json: it may be a file of the recording"),
        (["--touch-report", "touches/touches.json"], "touches/touches.json", "this command reads or writes that file"),
        (["--touch-report", "-"], "touches", "--touch-report -: a report cannot be written to a pipe"),
        (["--touch-report", "scan.ply/r.json"], "touches", "scan.ply is a file: name a file in another folder"),
    ],
)
def test_a_mistake_is_one_line_before_the_work(folder, monkeypatch, more, touches, said):
    monkeypatch.setattr(module, "register", None)
    done = upsample(*more, touches=touches)
    assert (done.exit_code, said in done.stderr) == (2, True), done.output
    assert len(done.stderr.splitlines()) == 1
    assert read_points(folder / "scan.ply").shape == (400, 3)
    assert not (folder / "out.npy").exists()
    assert not (folder / "r.json").exists()


def test_touches_in_another_unit_are_refused_before_they_are_registered(folder, monkeypatch):
    monkeypatch.setattr(module, "register", None)
    write(folder / "touches", by_hand.touches(0.001), overwrite=True)
    done = upsample()
    assert (done.exit_code, "it is in another unit or frame" in done.stderr) == (2, True), done.output


@pytest.mark.parametrize("more", [[], ["--touch-as-is"]])
def test_a_touch_far_from_the_cloud_is_left_out_and_named(folder, more):
    far = replace(by_hand.touches()[0], points=by_hand.touches()[0].points + 1e4)
    write(folder / "touches", [*by_hand.touches(), far], [*by_hand.NAMES, "far"], overwrite=True)
    done = upsample(*more)
    assert done.exit_code == 0, done.output
    assert "1 of" in done.stderr
    assert "touches are not used: far is 12" in done.stderr
    assert "it is in another unit or frame" in done.stderr
    assert f"of {len(by_hand.NAMES) + 1} touches to" in done.stderr
