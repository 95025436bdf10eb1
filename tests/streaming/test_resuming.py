"""An interrupted command continues, and its result has the bytes of an uninterrupted one, whoever does the work."""

import errno
import os
import shutil
import signal
import subprocess
import sys
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from types import SimpleNamespace

import pytest

from pcsr import RunError, UserError
from pcsr.clouds.formats import write_cloud
from pcsr.errors import PcsrWarning
from pcsr.streaming import job
from pcsr.streaming.work_folder import WorkFolder
from tests.streaming.clouds import sheet, stream

ROOT = Path(__file__).parents[2]
KILLED = """
import os, signal, sys
from pathlib import Path
import pcsr
from pcsr.streaming import upsample_file

def advance(what, done, total):
    if what == sys.argv[1] and done > total / 2:
        os.kill(os.getpid(), signal.SIGKILL)

upsample_file(pcsr.load("midpoint"), Path("scan.ply"), Path("out.ply"), rate=2, tile=300, advance=advance)
"""


def interrupted_at(monkeypatch, name, number, error):
    """Let the saving of the so-manieth file whose name begins so fail once."""
    save, seen = WorkFolder.save, []

    def saved(self, file, array):
        if file.startswith(name):
            seen.append(file)
            if len(seen) == number:
                raise error
        save(self, file, array)

    monkeypatch.setattr(WorkFolder, "save", saved)


@pytest.mark.parametrize(("name", "number"), [("tile-", 3), ("examples", 1), ("new-", 1), ("new-", 4)])
def test_an_interrupted_command_continues_to_the_same_bytes(scan, tmp_path, monkeypatch, name, number):
    whole = stream(scan, tmp_path / "whole.ply")
    interrupted_at(monkeypatch, name, number, KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        stream(scan, tmp_path / "out.ply")
    assert not (tmp_path / "out.ply").exists()
    done = {path: path.stat().st_mtime_ns for path in (tmp_path / "out.ply.parts").glob("new-*")}
    assert len(done) == (number - 1 if name == "new-" else 0)
    again = []
    filled = job.Job._filled
    monkeypatch.setattr(job.Job, "_filled", lambda self, *args: again.append(1) or filled(self, *args))
    assert stream(scan, tmp_path / "out.ply") == whole
    assert len(again) == 8 - len(done)  # what was finished is not done again
    assert not (tmp_path / "out.ply.parts").exists()


@pytest.mark.parametrize("name", ["errors-", "new-"])
def test_errors_are_the_same_after_an_interruption(scan, tmp_path, monkeypatch, name):
    whole = stream(scan, tmp_path / "whole.ply", fields=["error"])
    interrupted_at(monkeypatch, name, 3, KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        stream(scan, tmp_path / "out.ply", fields=["error"])
    assert stream(scan, tmp_path / "out.ply", fields=["error"]) == whole


def test_an_interruption_while_the_result_is_written_costs_no_tile(scan, tmp_path, monkeypatch):
    whole = stream(scan, tmp_path / "whole.ply")

    def stopped(what, done, total):
        if what == "writing" and done > total / 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        stream(scan, tmp_path / "out.ply", advance=stopped)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.ply.parts", "scan.ply", "whole.ply"]
    monkeypatch.setattr(job.Job, "_filled", None)
    assert stream(scan, tmp_path / "out.ply") == whole


@pytest.mark.slow
@pytest.mark.parametrize("what", ["sorting", "upsampling", "writing"])
def test_a_killed_process_is_continued_to_the_same_bytes(scan, tmp_path, monkeypatch, what):
    monkeypatch.undo()  # in the other process patches have their usual size
    path = os.pathsep.join([str(ROOT), str(ROOT / "plugins"), os.environ.get("PYTHONPATH", "")])
    killed = subprocess.run([sys.executable, "-c", KILLED, what], cwd=tmp_path, env={**os.environ, "PYTHONPATH": path})
    assert killed.returncode == -signal.SIGKILL
    assert not (tmp_path / "out.ply").exists()
    assert stream(scan, tmp_path / "out.ply", rate=2) == stream(scan, tmp_path / "whole.ply", rate=2)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out.ply", "scan.ply", "whole.ply"]


@pytest.mark.slow
def test_two_processes_give_the_same_bytes(scan, tmp_path):
    assert stream(scan, tmp_path / "two.ply", jobs=2) == stream(scan, tmp_path / "one.ply")


@pytest.mark.dask
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_gives_the_same_bytes(scan, tmp_path):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster:
        other = stream(scan, tmp_path / "dask.ply", scheduler=cluster.scheduler_address)
    assert other == stream(scan, tmp_path / "one.ply")


def test_a_full_disk_is_explained_and_the_work_continues_later(scan, tmp_path, monkeypatch):
    whole = stream(scan, tmp_path / "whole.ply")
    interrupted_at(monkeypatch, "new-", 3, OSError(errno.ENOSPC, "No space left on device"))
    with pytest.raises(RunError, match=r"out\.ply\.parts is full, and up to 0\.\d+ MB more are written there: free"):
        stream(scan, tmp_path / "out.ply")
    assert stream(scan, tmp_path / "out.ply") == whole


def test_too_little_room_is_said_before_the_tiles_are_upsampled(scan, tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=1000))
    with pytest.raises(RunError, match=r"has 1 kB free, and \d+\.?\d* kB more are written there"):
        stream(scan, tmp_path / "out.ply")


def test_a_killed_worker_is_named_with_what_to_do(scan, tmp_path, monkeypatch):
    def died(*_, **__):
        raise RunError("a worker process died") from BrokenProcessPool("killed")

    monkeypatch.setattr(job, "densify", died)
    with pytest.raises(RunError, match="died; what is finished is kept: run the same command again"):
        stream(scan, tmp_path / "out.ply")


def test_other_options_do_not_continue_the_work(scan, tmp_path, monkeypatch):
    interrupted_at(monkeypatch, "new-", 2, KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        stream(scan, tmp_path / "out.ply")
    with pytest.raises(UserError, match="unfinished work of another command, whose --rate, --bad differed"):
        stream(scan, tmp_path / "out.ply", rate=2, bad="drop")
    write_cloud(scan, sheet(seed=1))
    with pytest.raises(UserError, match="whose input differed"):
        stream(scan, tmp_path / "out.ply")


def test_a_command_that_is_refused_leaves_no_folder_behind(scan, tmp_path):
    cloud = sheet()
    cloud.points[5] = float("nan")
    write_cloud(scan, cloud, bad="keep")
    with pytest.raises(UserError, match="not finite"):
        stream(scan, tmp_path / "out.ply")
    assert not (tmp_path / "out.ply.parts").exists()
    with pytest.warns(PcsrWarning):
        stream(scan, tmp_path / "out.ply", bad="drop")
    assert (tmp_path / "out.ply").exists()


@pytest.mark.parametrize("file", ["command.json", "plan.json", "tile-000007.npy", "new-000000.npy", "examples.npy"])
@pytest.mark.parametrize("content", [b"", b"[]", b"\x00garbage", None])
def test_a_damaged_folder_is_refused_with_the_remedy_and_kept(scan, tmp_path, monkeypatch, file, content):
    interrupted_at(monkeypatch, "new-", 3, KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        stream(scan, tmp_path / "out.ply")
    damaged = tmp_path / "out.ply.parts" / file
    assert damaged.exists()
    if content is None:
        damaged.write_bytes(damaged.read_bytes()[: damaged.stat().st_size // 2])
    else:
        damaged.write_bytes(content)
    with pytest.raises(UserError, match=r"out.ply.parts holds unfinished work .*(damaged|another command)"):
        stream(scan, tmp_path / "out.ply")
    assert not (tmp_path / "out.ply").exists()
    assert damaged.exists()


def test_rows_that_are_missing_at_the_end_are_noticed(scan, tmp_path, monkeypatch):
    interrupted_at(monkeypatch, "new-", 3, KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt):
        stream(scan, tmp_path / "out.ply")
    finished = WorkFolder(tmp_path / "out.ply")
    finished.save("new-000000", finished.load("new-000000")[:-1])
    with pytest.raises(UserError, match="damaged or missing: remove the folder to begin anew"):
        stream(scan, tmp_path / "out.ply")
    assert not (tmp_path / "out.ply").exists()
