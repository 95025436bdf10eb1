"""How many threads torch has: in a block, after it, in other threads, in operations and in commands."""

import json
import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from torch import nn

import pcsr
from pcsr.contracts import Trait
from pcsr.network.network import Network
from pcsr.threads import PASSIVE, WAIT_VARIABLES, WORK_PER_THREAD, allowed, single_thread, thread_count, threads
from pcsr.upsample import densify
from pcsr.upsample.candidates import Candidates


@pytest.fixture
def four():
    """Four threads, in this thread and in those that begin, whatever the suite has."""
    before = torch.get_num_threads()
    torch.set_num_threads(4)
    yield 4
    torch.set_num_threads(before)


def in_new_thread(work):
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(work).result()


def test_a_block_limits_and_gives_back(four):
    with threads(1) as used:
        assert (used, torch.get_num_threads(), allowed()) == (1, 1, 4)
    assert (torch.get_num_threads(), allowed()) == (4, 4)


def test_a_block_never_raises_the_number(four):
    with threads(64) as used:
        assert (used, torch.get_num_threads()) == (4, 4)


def test_of_nested_blocks_the_strictest_counts(four):
    with threads(2):
        with threads(3) as used:
            assert (used, torch.get_num_threads(), allowed()) == (2, 2, 4)
            with threads(1):
                assert (torch.get_num_threads(), allowed()) == (1, 4)
            assert torch.get_num_threads() == 2
        assert torch.get_num_threads() == 2
    assert torch.get_num_threads() == 4


def test_an_error_gives_back_too(four):
    with pytest.raises(ZeroDivisionError), threads(1):
        1 / 0  # noqa: B018
    assert (torch.get_num_threads(), allowed()) == (4, 4)


def test_what_the_block_sets_itself_is_undone(four):
    with threads(2):
        torch.set_num_threads(3)
    assert torch.get_num_threads() == 4


def test_it_decorates_functions_that_call_themselves(four):
    @threads(2)
    def down(depth):
        return [torch.get_num_threads(), *(down(depth - 1) if depth else [])]

    assert down(3) == [2, 2, 2, 2]
    assert torch.get_num_threads() == 4


def test_threads_that_begin_during_a_block_have_what_they_would_have_had(four):
    with threads(1):
        assert in_new_thread(torch.get_num_threads) == 4
        assert torch.get_num_threads() == 1


def test_what_another_thread_chose_for_the_process_is_kept(four):
    with threads(1):
        in_new_thread(lambda: torch.set_num_threads(3))
    assert torch.get_num_threads() == 4
    assert in_new_thread(torch.get_num_threads) == 3


def test_blocks_in_many_threads_at_once_leave_no_wrong_number(four):
    begin = threading.Barrier(8)

    def work(number):
        begin.wait()
        found = set()
        for k in range(20):
            with threads(1 + (number + k) % 3) as used:
                found.add(torch.get_num_threads() == used == 1 + (number + k) % 3)
            found.add(torch.get_num_threads() == 4)
        return found

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(work, range(8))) == [{True}] * 8
    assert (torch.get_num_threads(), in_new_thread(torch.get_num_threads)) == (4, 4)


def test_a_thread_can_be_set_for_good(four):
    def work():
        single_thread()
        return torch.get_num_threads()

    assert in_new_thread(work) == 1
    assert (torch.get_num_threads(), in_new_thread(torch.get_num_threads)) == (4, 4)


@pytest.mark.parametrize(
    ("points", "weights", "count"),
    [
        (1, 1, 1),
        (8 * 128, 43_867, 1),
        (WORK_PER_THREAD, 1, 1),
        (2, WORK_PER_THREAD, 2),
        (10 * WORK_PER_THREAD - 1, 1, 9),
        (8 * 512, 1_548_419, 126),
    ],
)
def test_a_pass_deserves_a_thread_for_so_much_work(points, weights, count):
    assert thread_count(points, weights) == count


class Spy(Network):
    """Notes how many threads it sees; what it makes is noise around the points."""

    def __init__(self):
        nn.Module.__init__(self)
        self.weight = nn.Parameter(torch.zeros(1))
        self.seen = []
        self.upsampler = SimpleNamespace(traits={Trait.ANY_RATE}, corrects_points=False)
        self.encoder = self.backbone = SimpleNamespace(traits=())
        self.touch_encoder = None

    def candidates(self, points, rate, touches=None):
        self.seen.append(torch.get_num_threads())
        generator = torch.Generator().manual_seed(0)
        return points.repeat(1, rate, 1) + 0.05 * torch.randn(1, rate * points.shape[1], 3, generator=generator), None


@pytest.fixture
def model():
    """The default model with a spy in place of its network."""
    loaded = pcsr.load()
    return pcsr.Model("spy", Spy(), loaded.recipe, {}, None, ())


@pytest.fixture
def cloud():
    points = np.random.default_rng(0).normal(size=(600, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


@pytest.mark.parametrize("mode", [torch.inference_mode, torch.enable_grad, torch.no_grad])
def test_patches_have_one_thread_wherever_they_are_made(four, model, cloud, mode):
    with mode():
        model.upsample(cloud, rate=2)
    assert set(model.network.seen) == {1}
    assert torch.get_num_threads() == 4
    in_new_thread(lambda: model.upsample(cloud, rate=2))
    assert set(model.network.seen) == {1}
    assert (torch.get_num_threads(), in_new_thread(torch.get_num_threads)) == (4, 4)


def test_two_threads_may_upsample_at_once(four, model, cloud):
    def work(_):
        made = model.upsample(cloud, rate=2)
        return torch.get_num_threads(), made

    with ThreadPoolExecutor(2) as pool:
        (first, one), (second, other) = pool.map(work, range(2))
    assert (first, second) == (4, 4)
    assert set(model.network.seen) == {1}
    np.testing.assert_array_equal(one, other)


def test_a_network_that_fails_gives_the_threads_back(four, cloud):
    class Failing(Candidates):
        size, rate, any_rate = 512, 16, True

        def __call__(self, points, touches, rate):
            assert torch.get_num_threads() == 1
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        densify(cloud, 1200, Failing())
    assert torch.get_num_threads() == 4


def test_metrics_give_the_threads_back(four):
    rng = np.random.default_rng(0)
    one, other = rng.normal(size=(2, 1500, 3))
    four_threads = pcsr.evaluate(one, other)
    assert (torch.get_num_threads(), in_new_thread(torch.get_num_threads)) == (4, 4)
    torch.set_num_threads(1)
    assert pcsr.evaluate(one, other) == four_threads


ENVIRONMENT = "import json, os, sys; print(json.dumps([dict(os.environ), 'torch' in sys.modules]))"
COMMAND = f"""
import click, pcsr.cli
@click.command()
def spy():
    {ENVIRONMENT}
pcsr.cli.Commands.get_command = lambda self, ctx, name: spy
pcsr.cli.main(["evaluate"])
"""


@pytest.mark.parametrize(
    ("given", "seen"),
    [
        ({}, PASSIVE),
        ({"OMP_WAIT_POLICY": "ACTIVE"}, {"OMP_WAIT_POLICY": "ACTIVE"}),
        ({"GOMP_SPINCOUNT": "100"}, {"GOMP_SPINCOUNT": "100"}),
        ({"KMP_BLOCKTIME": "200"}, {"KMP_BLOCKTIME": "200"}),
    ],
)
def test_commands_wait_passively_unless_told_otherwise(given, seen):
    """Before torch is there, as OpenMP reads its environment once."""
    environment = {key: value for key, value in os.environ.items() if key not in WAIT_VARIABLES} | given
    done = subprocess.run([sys.executable, "-c", COMMAND], env=environment, capture_output=True, text=True, check=True)
    found, torch_is_there = json.loads(done.stdout)
    assert {key: found[key] for key in WAIT_VARIABLES if key in found} == seen
    assert not torch_is_there
