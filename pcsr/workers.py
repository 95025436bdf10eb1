"""Pools of worker processes, on this machine or on a running Dask cluster."""

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
"""Tasks in flight for each process. It bounds the results that wait in memory for an earlier one."""
MOST_JOBS = 61 if sys.platform == "win32" else 1024
"""Most processes of a pool. Windows cannot wait for more than 61 at once."""

Input = TypeVar("Input")
Output = TypeVar("Output")


@dataclass(frozen=True)
class WorkerPool:
    """Pool of processes that apply one function to many inputs."""

    executor: Executor | None
    """Executor of the pool; None runs the function in this process."""
    size: int
    """Number of processes."""

    def map(self, function: Callable[[Input], Output], inputs: Iterable[Input]) -> Iterator[Output]:
        """Apply a function to each input and yield the results in order.

        At most `AHEAD` × `size` inputs are read ahead of the result that is asked for.

        Raises:
            RunError: a process died, or the cluster is lost.
        """
        if self.executor is None:
            yield from map(function, inputs)
            return
        waiting: deque[Future[Output]] = deque()
        try:
            for each in inputs:
                with _children_ignore_interrupts():
                    waiting.append(self.executor.submit(function, each))
                if len(waiting) > AHEAD * self.size:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        except BrokenProcessPool as error:
            raise RunError(f"a worker process died ({error}), perhaps for lack of memory: try --jobs 1") from error
        finally:
            for future in waiting:
                future.cancel()


@contextmanager
def _children_ignore_interrupts() -> Iterator[None]:
    """Let processes that are started in the block ignore Ctrl-C; the parent process ends them."""
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
    """Open a pool of processes for the length of a block.

    Args:
        jobs: number of processes on this machine, at most `MOST_JOBS`; one for each core by default.
        scheduler: address of a Dask scheduler, such as `tcp://10.0.0.1:8786`, whose workers replace the processes of
            this machine. pcsr and the plugins must be installed there.

    Raises:
        UserError: `jobs` is out of range, the extra `[cluster]` is not installed, or the scheduler does not answer or
            has no workers.
    """
    check_jobs(jobs)
    if scheduler is not None:
        with _cluster(scheduler) as pool:
            yield pool
        return
    jobs = jobs or min(os.cpu_count() or 1, MOST_JOBS)
    if jobs == 1:
        yield WorkerPool(None, 1)
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, _start_worker) as executor:
        yield WorkerPool(executor, jobs)


def check_jobs(jobs: int | None) -> None:
    """Check a number of processes.

    Raises:
        UserError: it is less than 1 or more than `MOST_JOBS`.
    """
    if jobs is not None and not 1 <= jobs <= MOST_JOBS:
        raise UserError(f"jobs is {jobs}: give a number of processes from 1 to {MOST_JOBS}")


def _start_worker() -> None:
    """Set up a worker process with one torch thread: each other core has its own worker."""
    end_with_parent()
    import torch  # a pool of one process never loads it

    torch.set_num_threads(1)


def end_with_parent() -> None:
    """End this process as soon as its parent process ends, for whatever reason. Without a parent it does nothing.

    A killed parent cannot stop its children, which would then wait for work forever. Only the parent holds the other
    end of the sentinel, so the system closes it when the parent ends, on every platform. The resource tracker of
    multiprocessing removes the shared semaphores after the last process.
    """
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(target=_exit_after, args=(parent.sentinel,), daemon=True).start()


def _exit_after(sentinel: int) -> None:
    wait([sentinel])
    os._exit(1)  # nobody is left to receive a result or an error


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
