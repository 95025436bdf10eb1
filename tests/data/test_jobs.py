"""Samples made in other processes, and on a cluster of which one worker dies."""

import json
import os
import signal

import pytest

from pcsr.data.build import build_split
from pcsr.data.jobs import _make_chunk, _worker
from pcsr.data.plan import Plan
from pcsr.errors import RunError
from pcsr.workers import WorkerPool, worker_pool


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
    file = tmp_path / "world.py"
    file.write_text(world.read_text())
    plain, files = json.dumps(recipe("count=2").resolved()), (str(file),)
    assert len(_make_chunk(plain, files, ("train/000",))) == 1, "the same code under another path"
    _worker.cache_clear()
    file.write_text(world.read_text() + "\n")
    with pytest.raises(RunError, match=r"the code of world\.py differs between the processes of one build"):
        _make_chunk(plain, files, ("train/000",))
