"""Work in other processes, and on a cluster of which one worker dies."""

import os
import signal
import sys

import pytest

from pcsr import RunError, UserError
from pcsr.data.build import build_split
from pcsr.data.plan import Plan
from pcsr.data.workers import AHEAD, Crew, crew


def double(number):
    return 2 * number


def die(number):
    os.kill(os.getpid(), signal.SIGKILL)


def test_a_crew_keeps_the_order():
    with crew(2) as two:
        assert list(two.map(double, range(50))) == [2 * i for i in range(50)]
    with crew(1) as alone:
        assert alone == Crew(None, 1)
        assert list(alone.map(double, range(5))) == [0, 2, 4, 6, 8]


def test_only_a_few_results_wait_to_be_taken():
    taken = []

    def given():
        for number in range(100):
            taken.append(number)
            yield number

    with crew(2) as two:
        stream = two.map(double, given())
        for number in range(20):
            assert next(stream) == 2 * number
        assert len(taken) <= 20 + 2 * AHEAD + 1
        stream.close()


def test_a_process_that_dies_is_one_line():
    with pytest.raises(RunError, match=r"a process that was building data died.*--jobs 1"), crew(2) as two:
        list(two.map(die, range(4)))


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(UserError, match=r"needs Dask: pip install 'pcsr\[cluster\]'"), crew(scheduler="tcp://x:1"):
        pass


@pytest.mark.filterwarnings("ignore")
def test_a_cluster_whose_worker_is_killed_makes_the_same_bytes(recipe, registry, tmp_path):
    distributed = pytest.importorskip("distributed")
    plan = Plan.of(recipe("count=150", "rate=16"), registry)
    build_split(plan, "train", tmp_path / "here", Crew(None, 1))
    done = 0
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster:
        victim = next(iter(cluster.workers.values())).pid

        def advance(count):
            nonlocal done
            done += count
            if done == 30:
                os.kill(victim, signal.SIGKILL)

        with crew(scheduler=cluster.scheduler_address) as workers:
            assert workers.size == 2
            build_split(plan, "train", tmp_path / "there", workers, advance)
    assert done == 150
    here, there = ({p.name: p.read_bytes() for p in (tmp_path / name).iterdir()} for name in ("here", "there"))
    assert here == there


@pytest.mark.filterwarnings("ignore")
def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    distributed = pytest.importorskip("distributed")

    def refuse(address, timeout):
        raise OSError("Timed out trying to connect")

    monkeypatch.setattr(distributed, "Client", refuse)
    with (
        pytest.raises(UserError, match="--scheduler tcp://no:1: no Dask scheduler answers"),
        crew(scheduler="tcp://no:1"),
    ):
        pass
