"""`pcsr register`, run as a person would run it."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from pcsr import PoseError
from pcsr import touches as module
from pcsr.cli import pcsr
from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import write_cloud, write_points
from pcsr.recorded import read, write
from tests.registration import by_hand


@pytest.fixture
def folder(tmp_path):
    """A scan and a recording of exact touches on it."""
    write_points(tmp_path / "scan.ply", by_hand.scan(20_000))
    write(tmp_path / "touches", by_hand.touches(), by_hand.NAMES, pose_error=PoseError(0.3, 0.2))
    return tmp_path


def register(folder, *more):
    words = ["register", folder / "scan.ply", "--touch", folder / "touches", *more]
    return CliRunner().invoke(pcsr, [str(word) for word in words])


def test_exact_touches_stay_and_the_corrected_recording_can_be_used(folder):
    done = register(folder, "-o", folder / "corrected", "--touch-report", folder / "report.json")
    assert done.exit_code == 0, done.output
    assert f"{folder / 'corrected'}: 3 of 3 touches, corrected" in done.stdout
    corrected = read(folder / "corrected")
    assert corrected.names == by_hand.NAMES
    plain = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    for given, one, said in zip(by_hand.touches(), corrected.touches, plain["touches"], strict=True):
        assert np.linalg.norm(said["moved"]) < 0.05
        assert len(one.points) == said["points_used"] > 0.5 * len(given.points)
    write_points(folder / "sparse.ply", by_hand.scan(400))
    used = ["upsample", folder / "sparse.ply", "--touch", folder / "corrected", "-o", folder / "dense.npy", "--rate", 2]
    again = CliRunner().invoke(pcsr, [str(word) for word in [*used, "--model", "midpoint", "--jobs", 1]])
    assert again.exit_code == 0, again.output
    assert "400 points and 3 of 3 touches to 800 by midpoint" in again.stderr


def test_the_table_and_the_offset_are_the_output(folder, made_by_hand):
    done = register(folder)
    assert done.exit_code == 0, done.output
    rows = [line.split() for line in done.stdout.splitlines()]
    assert ["left", "moved", "0.40", "0.00", "30", "0.05", "by", "its", "surface"] in rows
    assert ["[red]below", "refused", "–", "–", "2", "–", "it", "fits", "nowhere"] in rows
    assert "\nall touches share an offset of " in done.stdout
    assert "0.6 mm that all touches share" in done.stdout
    assert done.stderr == "touch [red]below is refused: it fits nowhere\n"
    assert made_by_hand == [PoseError(0.3, 0.2)]


def test_the_corrected_recording_has_no_refused_touches_and_the_error_that_is_left(folder, made_by_hand):
    done = register(folder, "-o", folder / "corrected", "--pose-error", "2,1")
    assert done.exit_code == 0, done.output
    assert "2 of 3 touches, corrected" in done.stdout
    corrected = read(folder / "corrected")
    assert corrected.names == by_hand.NAMES[:2]
    expected = by_hand.registration(by_hand.touches()).touches
    for one, other in zip(corrected.touches, expected, strict=False):
        np.testing.assert_array_equal(one.points, other.touch.points)
    assert corrected.pose_error.position == pytest.approx(0.05)
    assert made_by_hand == [PoseError(2.0, 1.0)]


def test_all_rows_are_printed(folder, made_by_hand):
    first, second, third = by_hand.touches()
    write(folder / "touches", [first, second, *[third] * 30], overwrite=True)
    done = register(folder)
    assert done.exit_code == 0, done.output
    assert done.stdout.count("it fits nowhere") == 30


def test_where_all_touches_are_refused_nothing_is_written(folder, monkeypatch):
    def refused(given, cloud, *, pose_error=None):
        found = by_hand.registration(given)
        return type(found)([found.touches[2]] * 3, *list(vars(found).values())[1:])

    monkeypatch.setattr(module, "register", refused)
    done = register(folder, "-o", folder / "corrected")
    assert (done.exit_code, "all 3 touches are refused" in done.stderr) == (1, True), done.output
    assert not (folder / "corrected").exists()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["-o", "touches"], "-o touches: that is the recording itself"),
        (["-o", "old"], "old holds a recording already: choose another folder, or overwrite it (--overwrite)"),
        (["-o", "scan.ply"], "is a file"),
        (["--touch-report", "."], "would be replaced by a file: name a file"),
        (["--touch-report", "scan.ply"], "this command reads or writes that file: name another one"),
        (["-o", "new", "--touch-report", "new"], "this command reads or writes that file: name another one"),
        (["-o", "new", "--touch-report", "new/touches.json"], "it may be a file of the recording: name one outside"),
        (["--pose-error", "0.3"], "--pose-error '0.3': it must be two numbers, millimetres and degrees, as in"),
    ],
)
def test_mistakes_are_said_before_the_work(folder, monkeypatch, more, said):
    monkeypatch.chdir(folder)
    write(folder / "old", by_hand.touches())
    monkeypatch.setattr(module, "register", None)
    done = CliRunner().invoke(pcsr, ["register", "scan.ply", "--touch", "touches", *more])
    assert (done.exit_code, said in done.stderr) == (2, True), done.output


def test_an_old_recording_is_replaced_if_asked(folder):
    write(folder / "old", [*by_hand.touches(), *by_hand.touches()])
    done = register(folder, "-o", folder / "old", "--overwrite")
    assert done.exit_code == 0, done.output
    assert len(read(folder / "old").touches) == 3


def test_faulty_points_are_refused_or_left_out(folder, made_by_hand):
    cloud = by_hand.scan()
    cloud[7] = np.nan
    write_cloud(folder / "scan.ply", Cloud(cloud), bad="keep")
    refused = register(folder)
    assert (refused.exit_code, "not finite" in refused.stderr) == (2, True), refused.output
    assert register(folder, "--bad", "drop").exit_code == 0
