"""The folder of unfinished work: of one command, for one process, and whole files only."""

import errno
import shutil
from types import SimpleNamespace

import numpy as np
import pytest

from pcsr import RunError, UserError
from pcsr.streaming.work_folder import WorkFolder, check_room, full_disk_explained


def test_what_was_saved_is_there_when_the_same_command_comes_again(tmp_path):
    work = WorkFolder(tmp_path / "out.ply")
    with work.opened({"--rate": 4}):
        assert work.plan() is None
        work.save("new-1", np.arange(5))
        work.save_plan({"tiles": [1, 2]})
    with work.opened({"--rate": 4}):
        assert work.has("new-1")
        assert not work.has("new-2")
        np.testing.assert_array_equal(work.load("new-1"), np.arange(5))
        assert work.plan() == {"tiles": [1, 2]}
    work.remove()
    assert list(tmp_path.iterdir()) == []


def test_the_work_of_another_command_is_refused_with_what_differs(tmp_path):
    work = WorkFolder(tmp_path / "out.ply")
    with work.opened({"input": "a", "--rate": 4}):
        pass
    with (
        pytest.raises(
            UserError, match=r"out\.ply\.parts holds .* whose --rate differed: run that .* or remove the folder"
        ),
        work.opened({"input": "a", "--rate": 3}),
    ):
        pass


def test_two_processes_do_not_share_a_folder(tmp_path):
    work = WorkFolder(tmp_path / "out.ply")
    with (
        work.opened({}),
        pytest.raises(UserError, match="is in use by another process"),
        WorkFolder(tmp_path / "out.ply").opened({}),
    ):
        pass


def test_a_folder_of_someone_else_is_left_alone(tmp_path):
    (tmp_path / "out.ply.parts").mkdir()
    (tmp_path / "out.ply.parts" / "thesis.tex").write_text("years of work")
    with pytest.raises(UserError, match="is in the way"), WorkFolder(tmp_path / "out.ply").opened({}):
        pass
    assert (tmp_path / "out.ply.parts" / "thesis.tex").read_text() == "years of work"


def test_a_full_disk_is_explained(tmp_path, monkeypatch):
    work = WorkFolder(tmp_path / "out.ply")
    work.needed = 3_000_000_000
    for error in (OSError(errno.ENOSPC, "No space left on device"), OSError(errno.EDQUOT, "Quota exceeded")):
        again = r"out\.ply\.parts is full, and up to 3 GB more are written there: free some space, and run the same"
        with pytest.raises(RunError, match=again), full_disk_explained(work):
            raise error
    with pytest.raises(OSError, match="denied"), full_disk_explained(work):
        raise OSError(errno.EACCES, "denied")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=10**9))
    with pytest.raises(RunError, match=r"has 1 GB free, and 3 GB more are written there: free some space"):
        check_room(work)
    work.needed = 10**9
    check_room(work)


def test_halves_of_files_that_a_killed_process_left_are_removed(tmp_path):
    work = WorkFolder(tmp_path / "out.ply")
    with work.opened({}):
        (work.path / ".new-1.npy.7.part").touch()
        (tmp_path / ".out.ply.7.part").touch()
        (tmp_path / ".other.ply.7.part").touch()
    with work.opened({}):
        assert not (work.path / ".new-1.npy.7.part").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == [".other.ply.7.part", "out.ply.parts"]
