"""Batches made by other processes are those made in place."""

import os
import signal
import sys

import pytest
import torch

from pcsr.data.batches import Batches
from pcsr.data.loading import prepared
from pcsr.errors import UserError
from tests.data.test_batches import ALL, batches, clouds, split
from tests.processes import alive, killed_while, wait_for


class ProcessBatches(Batches):
    """Says who made a batch, in the place of what it holds."""

    def at(self, step, rank=0, ranks=1):
        batch = super().at(step, rank, ranks)
        object.__setattr__(batch, "truth", torch.tensor([os.getpid(), os.getpgrp(), torch.get_num_threads()]))
        return batch


@pytest.mark.parametrize(("rank", "ranks"), [(0, 1), (1, 2)])
@pytest.mark.parametrize("loaders", [0, 2])
def test_batches_are_those_made_in_place_and_in_their_order(loaders, rank, ranks):
    loaded = list(prepared(batches(*ALL), range(2, 11), loaders, rank, ranks))
    assert len(loaded) == 9
    for step, batch in enumerate(loaded, start=2):
        for one, other in zip(clouds(batch), clouds(batches(*ALL).at(step, rank, ranks)), strict=True):
            assert torch.equal(one, other), step


def test_they_are_made_by_as_many_processes_with_a_thread_each():
    made = [batch.truth.tolist() for batch in prepared(ProcessBatches(split(), 4, (0, 2), (), 3), range(8), 2)]
    makers = {maker for maker, _, _ in made}
    assert len(makers) == 2
    assert os.getpid() not in makers
    assert {threads for _, _, threads in made} == {1}


def test_a_stop_of_the_process_group_leaves_the_loaders_alone_so_that_the_step_in_hand_ends():
    """As Ctrl-C and a scheduler's polite kill do, which go to all of a group."""
    signals = []
    before = signal.signal(signal.SIGTERM, lambda *_: signals.append(True))
    try:
        ahead = iter(prepared(ProcessBatches(split(), 4, (0, 2), (), 3), range(40), 2))
        maker, group, _ = next(ahead).truth.tolist()
        assert group == maker != os.getpgrp()
        os.kill(os.getpid(), signal.SIGTERM)
        assert signals
        assert len(list(ahead)) == 39
    finally:
        signal.signal(signal.SIGTERM, before)


PARENT = """
import os, pathlib, time
from pcsr.data.batches import Batches
from pcsr.data.loading import prepared
from tests.data.test_batches import split

class Slow(Batches):
    def at(self, step, rank=0, ranks=1):
        pathlib.Path(f"{os.getpid()}.ready").touch()
        time.sleep(60)

list(prepared(Slow(split(), 4, (0, 2), (), 3), range(8), 2))
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="it asks ps")
def test_loaders_end_with_a_training_that_was_killed(tmp_path):
    with killed_while(PARENT, "", tmp_path, ready=2) as (loaders, _):
        assert len(loaders) == 2
        assert wait_for(lambda: not any(map(alive, loaders)), 2)


def test_no_process_is_started_where_none_is_asked_for():
    assert {batch.truth[0].item() for batch in prepared(ProcessBatches(split(), 4, (0, 2), (), 3), range(3), 0)} == {
        os.getpid()
    }


@pytest.mark.slow
def test_loaders_work_where_processes_are_spawned_and_all_is_handed_over():
    loader = prepared(batches(*ALL), range(3), 1)
    loader.multiprocessing_context = "spawn"
    made = list(loader)
    assert len(made) == 3
    for step, batch in enumerate(made):
        assert torch.equal(batch.points, batches(*ALL).at(step).points)


@pytest.mark.parametrize("loaders", [0, 2])
def test_after_the_last_step_there_is_nothing_to_load(loaders):
    assert list(prepared(batches(), range(7, 7), loaders)) == []


def test_a_failing_loader_ends_the_training_and_says_why():
    class Broken(Batches):
        def at(self, step, rank=0, ranks=1):
            raise UserError("no such object")

    with pytest.raises(UserError, match="no such object"):
        list(prepared(Broken(split(), 4, (0, 2), (), 3), range(5), 1))
