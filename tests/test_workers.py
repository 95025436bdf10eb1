"""Work in other processes."""

import os
import signal
import sys

import pytest

from pcsr import RunError, UserError
from pcsr.workers import AHEAD, WorkerPool, worker_pool


def double(number):
    return 2 * number


def die(number):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_pool_keeps_the_order():
    with worker_pool(2) as two:
        assert list(two.map(double, range(50))) == [2 * i for i in range(50)]
    with worker_pool(1) as alone:
        assert alone == WorkerPool(None, 1)
        assert list(alone.map(double, range(5))) == [0, 2, 4, 6, 8]


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


def test_a_process_that_dies_is_one_line():
    with pytest.raises(RunError, match=r"a worker process died.*--jobs 1"), worker_pool(2) as two:
        list(two.map(die, range(4)))


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
