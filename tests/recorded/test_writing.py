"""Recordings that are written: they come back to the last bit, and nothing is overwritten by mistake."""

import os

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pcsr import PoseError, RunError, Touch, UserError
from pcsr.recorded import MANIFEST, read, write
from tests.recorded.recordings import CLOUD, one_touch

LENGTHS = st.floats(0.01, 1000)


@st.composite
def random_touches(draw):
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    unit = draw(LENGTHS)
    touches = []
    for _ in range(draw(st.integers(1, 3))):
        fingers, n = draw(st.integers(1, 4)), draw(st.integers(1, 9))
        posed = draw(st.booleans())
        poses = np.tile(np.eye(4), (fingers, 1, 1))
        poses[:, :3, :3] = Rotation.random(fingers, rng).as_matrix() / unit
        poses[:, :3, 3] = rng.normal(size=(fingers, 3)) * 10 ** rng.uniform(-9, 9)
        points = rng.normal(size=(n, 3)) * 10 ** rng.uniform(-9, 9)
        finger = rng.integers(0, fingers, n)
        area = draw(st.none() | st.floats(0, 1e6))
        touches.append(Touch(points, finger, poses if posed else poses[:0], unit, draw(st.sampled_from("ab+ü")), area))
    return touches


@settings(max_examples=60)
@given(touches=random_touches())
def test_what_is_written_comes_back_to_the_last_bit(tmp_path_factory, touches):
    folder = tmp_path_factory.mktemp("recording")
    names = [f"touch {number}" for number in range(len(touches))]
    write(folder, touches, names)
    recording = read(folder)
    assert recording.names == names
    assert not recording.skipped
    for a, b in zip(touches, recording.touches, strict=True):
        for field in ("points", "finger", "poses"):
            one, other = getattr(a, field), getattr(b, field)
            assert one.dtype == other.dtype
            assert one.shape == other.shape
            assert one.tobytes() == other.tobytes()
        assert (a.unit, a.sensor, a.contact_area) == (b.unit, b.sensor, b.contact_area)


@pytest.mark.parametrize("error", [None, PoseError(0.0, 0.0), PoseError(0.1 + 0.2, 45.0)])
def test_the_error_of_the_poses_comes_back(tmp_path, error):
    write(tmp_path, [one_touch()], pose_error=error)
    assert read(tmp_path).pose_error == error


def test_a_recording_is_not_overwritten_unless_asked(tmp_path):
    write(tmp_path / "new" / "folder", [one_touch()])
    folder = tmp_path / "new" / "folder"
    assert read(folder).names == ["0.ply"]
    with pytest.raises(UserError, match="holds a recording already"):
        write(folder, [one_touch(points=CLOUD + 1)])
    np.testing.assert_array_equal(read(folder).touches[0].points, CLOUD)
    write(folder, [one_touch(points=CLOUD + 1)], overwrite=True)
    np.testing.assert_array_equal(read(folder).touches[0].points, CLOUD + 1)


def test_a_recording_that_was_not_finished_has_no_manifest_and_can_be_written_again(tmp_path, monkeypatch):
    real = os.replace

    def full(source, target):
        if str(target).endswith("1.ply"):
            raise OSError(28, "No space left on device")
        real(source, target)

    with monkeypatch.context() as patched:
        patched.setattr(os, "replace", full)
        with pytest.raises(RunError, match=r"1\.ply could not be written"):
            write(tmp_path, [one_touch(), one_touch()])
    with pytest.raises(UserError, match="cannot be read"):
        read(tmp_path)
    write(tmp_path, [one_touch(), one_touch()])
    assert len(read(tmp_path).touches) == 2


@pytest.mark.parametrize(
    ("touches", "expected"),
    [
        ([], r"must have the same unit, got units of \[\]"),
        (
            [one_touch(), one_touch(unit=2.0, poses=np.zeros((0, 4, 4)))],
            r"must have the same unit, got units of \[1.0, 2.0\]",
        ),
        ([one_touch(points=CLOUD * np.nan)], "touch 0 by 'x' cannot be recorded"),
        ([one_touch(points=CLOUD[:0], finger=np.zeros(0, np.int64))], "cannot be recorded: it has 0 points"),
        ([one_touch(finger=np.array([0, 1]))], "of 2 fingers and 1 poses"),
        ([one_touch(contact_area=float("nan"))], "its contact area is nan"),
        ([one_touch(poses=2 * np.eye(4)[None])], "touch 0: pose 0: its last row"),
        ([one_touch(unit=5.0)], "touch 0: pose 0 scales by 1, .* require 0.2"),
    ],
)
def test_touches_that_could_not_be_read_again_are_not_written(tmp_path, touches, expected):
    with pytest.raises(UserError, match=expected):
        write(tmp_path, touches)
    assert not list(tmp_path.iterdir())


def test_each_touch_needs_a_name_or_none_does(tmp_path):
    with pytest.raises(UserError, match="1 names for 2 touches"):
        write(tmp_path, [one_touch(), one_touch()], ["a"])


def test_a_file_of_somebody_elses_is_never_overwritten(tmp_path):
    (tmp_path / "0.ply").write_text("a mesh")
    for overwrite in (False, True):
        with pytest.raises(UserError, match=r"0\.ply exists already and belongs to no recording"):
            write(tmp_path, [one_touch()], overwrite=overwrite)
    assert (tmp_path / "0.ply").read_text() == "a mesh"
    assert not (tmp_path / MANIFEST).exists()


def test_overwriting_leaves_nothing_of_the_old_recording(tmp_path):
    write(tmp_path, [one_touch(), one_touch(), one_touch()])
    (tmp_path / "notes.txt").write_text("mine")
    write(tmp_path, [one_touch()], overwrite=True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["0.ply", "notes.txt", MANIFEST]


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_a_write_that_is_stopped_leaves_nothing(tmp_path, monkeypatch, error):
    real = os.replace

    def full(source, target):
        if str(target).endswith("2.ply"):
            raise error
        real(source, target)

    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "notes.txt").write_text("mine")
    monkeypatch.setattr(os, "replace", full)
    for folder in (tmp_path / "mine", tmp_path / "new"):
        with pytest.raises((RunError, KeyboardInterrupt)):
            write(folder, [one_touch()] * 4)
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["notes.txt"]
    assert not (tmp_path / "new").exists()
