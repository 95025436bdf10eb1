"""Samples made in other processes, and on a cluster of which one worker dies."""

import dataclasses
import os
import signal

import pytest

from pcsr.data.build import build_split
from pcsr.data.jobs import results
from pcsr.data.plan import Plan
from pcsr.errors import RunError
from pcsr.workers import WorkerPool, worker_pool


@pytest.mark.dask
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_whose_worker_is_killed_makes_the_same_bytes(recipe, registry, tmp_path):
    distributed = pytest.importorskip("distributed")
    plan = Plan.of(recipe("count=150", "rate=16"), registry)
    build_split(plan, "train", tmp_path / "here", WorkerPool(None, 1))
    done = 0
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster:
        victim = next(iter(cluster.workers.values())).pid

        def advance(count):
            nonlocal done
            done += count
            if done == 30:
                os.kill(victim, signal.SIGKILL)

        with worker_pool(scheduler=cluster.scheduler_address) as workers:
            assert workers.size == 2
            build_split(plan, "train", tmp_path / "there", workers, advance)
    assert done == 150
    here, there = ({p.name: p.read_bytes() for p in (tmp_path / name).iterdir()} for name in ("here", "there"))
    assert here == there


def test_a_plugin_that_is_edited_while_it_is_used_elsewhere_is_not_mixed_in(recipe, registry, world, tmp_path):
    plan, pool = Plan.of(recipe("count=2"), registry), WorkerPool(None, 1)
    same, edited = tmp_path / "same" / "world.py", tmp_path / "edited" / "world.py"
    for file, end in ((same, ""), (edited, "\n")):
        file.parent.mkdir()
        file.write_text(world.read_text() + end)
    assert len(list(results(dataclasses.replace(plan, files=(same,)), ["train/000"], pool))) == 1
    with pytest.raises(RunError, match=r"the code of world\.py differs between the processes of one build"):
        list(results(dataclasses.replace(plan, files=(edited,)), ["train/000"], pool))
