"""Work in other processes."""

import os
import signal
import sys
from pathlib import Path

import pytest

from pcsr import RunError, UserError
from pcsr.workers import AHEAD, MOST_JOBS, WorkerPool, end_with_parent, worker_pool
from tests.processes import alive, killed_while, wait_for


def double(number):
    return 2 * number


def die(number):
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.slow
def test_a_pool_keeps_the_order():
    with worker_pool(2) as two:
        assert list(two.map(double, range(50))) == [2 * i for i in range(50)]
    with worker_pool(1) as alone:
        assert alone == WorkerPool(None, 1)
        assert list(alone.map(double, range(5))) == [0, 2, 4, 6, 8]


@pytest.mark.slow
def test_only_a_few_results_wait_to_be_taken():
    taken = []

    def given():
        for number in range(100):
            taken.append(number)
            yield number

    with worker_pool(2) as two:
        stream = two.map(double, given())
        for number in range(20):
            assert next(stream) == 2 * number
        assert len(taken) <= 20 + 2 * AHEAD + 1
        stream.close()


@pytest.mark.slow
def test_a_process_that_dies_is_one_line():
    with pytest.raises(RunError, match=r"a worker process died.*--jobs 1"), worker_pool(2) as two:
        list(two.map(die, range(4)))


PARENT = """
import os, pathlib, sys, time
from pcsr.workers import worker_pool

def work(seconds):
    pathlib.Path(f"{os.getpid()}.ready").touch()
    time.sleep(seconds)

if __name__ == "__main__":
    with worker_pool(2) as two:
        list(two.map(work, [60] * 4 if sys.argv[1] == "working" else [0.2] * 8))
        pathlib.Path("done.ready").touch()
        time.sleep(60)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="it asks ps")
@pytest.mark.parametrize("doing", ["working", "waiting"])
def test_workers_end_with_a_parent_that_was_killed_and_leave_no_semaphore(tmp_path, doing):
    with killed_while(PARENT, doing, tmp_path, ready=2 if doing == "working" else 3) as (workers, shared):
        assert len(workers) == 2
        assert shared or not Path("/proc/self/maps").exists()
        assert wait_for(lambda: not any(map(alive, workers)), 2)
        assert wait_for(lambda: not any(map(os.path.exists, shared)), 2)


def test_a_process_without_a_parent_of_its_own_goes_on():
    end_with_parent()


@pytest.mark.parametrize("jobs", [0, -1, 10**18, MOST_JOBS + 1])
def test_an_impossible_number_of_processes_is_refused(jobs):
    with pytest.raises(UserError, match=rf"jobs is {jobs!r}: .* from 1 to {MOST_JOBS}"), worker_pool(jobs):
        pass


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(UserError, match=r"needs distributed, which is not installed: pip install 'pcsr\[cluster\]'"),
        worker_pool(scheduler="tcp://x:1"),
    ):
        pass


@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    distributed = pytest.importorskip("distributed")

    def refuse(address, timeout):
        raise OSError("Timed out trying to connect")

    monkeypatch.setattr(distributed, "Client", refuse)
    with (
        pytest.raises(UserError, match="--scheduler tcp://no:1: no Dask scheduler answers"),
        worker_pool(scheduler="tcp://no:1"),
    ):
        pass
