"""Work in many processes: of this machine, or of a Dask cluster that is running already."""

import multiprocessing
import os
import signal
import sys
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import wait
from typing import TypeVar

from pcsr.errors import RunError, UserError
from pcsr.extras import imported

AHEAD = 4
"""Tasks in flight for each process: results wait in memory until those before them are taken."""
MOST_JOBS = 61 if sys.platform == "win32" else 1024
"""Processes of one pool at most. Windows waits for no more of them at once."""

Given = TypeVar("Given")
Made = TypeVar("Made")


@dataclass(frozen=True)
class WorkerPool:
    """Processes that apply one function to many inputs."""

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
            raise RunError(f"a worker process died ({error}): out of memory? try --jobs 1") from error
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
def worker_pool(jobs: int | None = None, scheduler: str | None = None) -> Iterator[WorkerPool]:
    """Processes for as long as the context lasts.

    Args:
        jobs: processes on this machine, at most `MOST_JOBS`; all cores by default.
        scheduler: address of a Dask scheduler, such as `tcp://10.0.0.1:8786`; its workers are used instead. pcsr
            and the plugins must be installed there.

    Raises:
        UserError: an impossible number of processes, the extra `[cluster]` is not installed, or no scheduler answers
            with workers.
    """
    check_jobs(jobs)
    if scheduler is not None:
        with _cluster(scheduler) as found:
            yield found
        return
    jobs = jobs or min(os.cpu_count() or 1, MOST_JOBS)
    if jobs == 1:
        yield WorkerPool(None, 1)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, _start_worker) as executor:
        yield WorkerPool(executor, jobs)


def check_jobs(jobs: int | None) -> None:
    """Refuse a number of processes that no pool has.

    Raises:
        UserError: it is less than 1 or more than `MOST_JOBS`.
    """
    if jobs is not None and not 1 <= jobs <= MOST_JOBS:
        raise UserError(f"jobs is {jobs}: give a number of processes from 1 to {MOST_JOBS}")


def _start_worker() -> None:
    """Set up a worker process: one thread, since the other cores have workers of their own."""
    end_with_parent()
    import torch  # here, so that a pool of one process never loads it

    torch.set_num_threads(1)


def end_with_parent() -> None:
    """Let this process end as soon as its parent has, however that ended; it does nothing in a process without one.

    A killed parent tells its children nothing, and they would wait for work for ever. Only the parent holds the other
    end of the sentinel, so the system closes it on every platform. The semaphores that the processes shared are
    removed by multiprocessing's resource tracker once all of them are gone.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_outlive_nobody, args=(parent.sentinel,), daemon=True).start()


def _outlive_nobody(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)  # nobody is left to take a result, or to be told of an error


@contextmanager
def _cluster(address: str) -> Iterator[WorkerPool]:
    distributed = imported("distributed", f"--scheduler {address}")
    cancelled = imported("distributed.client", f"--scheduler {address}").FutureCancelledError
    try:
        client = distributed.Client(address, timeout=20)
    except (OSError, TimeoutError, ValueError) as error:
        raise UserError(f"--scheduler {address}: no Dask scheduler answers ({error}): check the address") from error
    with client:
        size = sum(client.nthreads().values())
        if size == 0:
            raise UserError(f"--scheduler {address} has no workers: start some with `dask worker {address}`")
        try:
            yield WorkerPool(client.get_executor(pure=False, retries=3), size)
        except (cancelled, OSError, TimeoutError) as error:
            raise RunError(
                f"the Dask cluster at {address} was lost ({type(error).__name__}: {error}); what is finished is kept: "
                f"run the same command again"
            ) from error
