"""Making samples in many processes: of this machine, or of a Dask cluster that is running already."""

import functools
import json
import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import torch

from pcsr.contracts import Shapes, TouchSource
from pcsr.data.plan import Plan
from pcsr.data.sample import Rejected, Sample, make_sample
from pcsr.errors import RunError, UserError
from pcsr.plugins import load_plugins
from pcsr.recipe import Recipe, from_resolved
from pcsr.registry import Registry

CHUNK = 4
"""Objects that a process makes at a time: enough to hide the traffic, few enough to share evenly."""
AHEAD = 4
"""Chunks in flight for each process: what is finished waits in memory until those before it are written."""

Given = TypeVar("Given")
Made = TypeVar("Made")


@dataclass(frozen=True)
class Crew:
    """Processes that work."""

    executor: Executor | None
    """None: this process does it itself."""
    size: int

    def map(self, make: Callable[[Given], Made], given: Iterable[Given]) -> Iterator[Made]:
        """Results in order, with only a few of them ahead of the one asked for.

        Raises:
            RunError: a process died, or the cluster is lost.
        """
        if self.executor is None:
            yield from map(make, given)
            return
        waiting: deque[Future[Made]] = deque()
        try:
            for one in given:
                with _deaf_children():
                    waiting.append(self.executor.submit(make, one))
                if len(waiting) > AHEAD * self.size:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        except BrokenProcessPool as error:
            raise RunError(f"a process that was building data died ({error}): out of memory? try --jobs 1") from error
        finally:
            for future in waiting:
                future.cancel()


@contextmanager
def _deaf_children() -> Iterator[None]:
    """Processes that are started in here ignore Ctrl-C from their first moment: who gives the orders ends them."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def crew(jobs: int | None = None, scheduler: str | None = None) -> Iterator[Crew]:
    """Processes for as long as the context lasts.

    Args:
        jobs: processes on this machine; all cores by default.
        scheduler: address of a Dask scheduler, such as `tcp://10.0.0.1:8786`; its workers are used instead. pcsr
            and the plugins must be installed there.

    Raises:
        UserError: the extra `[cluster]` is not installed, or no scheduler answers with workers.
    """
    if scheduler is not None:
        with _cluster(scheduler) as found:
            yield found
        return
    jobs = jobs or os.cpu_count() or 1
    if jobs == 1:
        yield Crew(None, 1)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, torch.set_num_threads, (1,)) as executor:
        yield Crew(executor, jobs)


@contextmanager
def _cluster(address: str) -> Iterator[Crew]:
    try:
        from distributed import Client
        from distributed.client import FutureCancelledError
    except ImportError as error:
        raise UserError(f"--scheduler {address} needs Dask: pip install 'pcsr[cluster]'") from error
    try:
        client = Client(address, timeout=20)
    except (OSError, TimeoutError, ValueError) as error:
        raise UserError(f"--scheduler {address}: no Dask scheduler answers ({error}): check the address") from error
    with client:
        size = sum(client.nthreads().values())
        if size == 0:
            raise UserError(f"--scheduler {address} has no workers: start some with `dask worker {address}`")
        try:
            yield Crew(client.get_executor(pure=False, retries=3), size)
        except (FutureCancelledError, OSError, TimeoutError) as error:
            raise RunError(
                f"the Dask cluster at {address} was lost ({type(error).__name__}: {error}); what is finished is kept: "
                f"run the same command again"
            ) from error


def results(plan: Plan, names: Sequence[str], crew: Crew) -> Iterator[tuple[str, Sample | Rejected]]:
    """Each object's name with its sample, or with the reason why there is none, in order."""
    if len(names) <= 2 * CHUNK:  # to start processes would take longer
        crew = Crew(None, 1)
    recipe, files = json.dumps(plan.recipe.resolved()), tuple(str(file.resolve()) for file in plan.files)
    make = functools.partial(_make_chunk, recipe, files)
    chunks = [tuple(names[i : i + CHUNK]) for i in range(0, len(names), CHUNK)]
    for chunk, made in zip(chunks, crew.map(make, chunks), strict=True):
        yield from zip(chunk, made, strict=True)


def _make_chunk(recipe: str, files: tuple[str, ...], names: tuple[str, ...]) -> list[Sample | Rejected]:
    worker = _worker(recipe, files)
    return [worker.make(name) for name in names]


@functools.lru_cache(maxsize=2)
def _worker(recipe: str, files: tuple[str, ...]) -> "_Worker":
    # Plugins given as files are loaded in each process: their classes are not importable by name otherwise.
    registry = load_plugins([Path(file) for file in files])
    plain: dict[str, Any] = json.loads(recipe)
    return _Worker(from_resolved(plain, registry), registry)


class _Worker:
    """What one process needs to make samples."""

    def __init__(self, recipe: Recipe, registry: Registry) -> None:
        self.recipe = recipe
        self.shapes: Shapes = recipe.data.shapes.build(registry, "shapes")
        self.source: TouchSource = recipe.data.touch.build(registry, "touch")

    def make(self, name: str) -> Sample | Rejected:
        """One sample, or the reason why there is none: one bad object does not stop the others."""
        recipe = self.recipe
        try:
            item = self.shapes.item(name)
            return make_sample(item, self.source, recipe.data, recipe.most_touches, recipe.data_seed)
        except UserError as error:
            return Rejected(str(error))
        except Exception as error:  # one object's trouble must not end hours of building
            return Rejected(f"{name}: {type(error).__name__}: {error}", fault=True)
