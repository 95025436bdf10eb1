"""Number of torch's threads, chosen by the size of the work.

The threads of an operation wait for each other at its end. On a busy machine one of them may have lost its core by
then, and the others wait for it in each of several thousand small operations. By default they wait actively, which
keeps the core from the thread that they wait for. The number of threads is therefore small for small work. It depends
on the work alone and never on the load, so that results do not depend on what else the machine does.

- A patch of `densify`, a metric, a check of a plugin: one thread. Processes (`jobs`) make these faster.
- A batch in training, and a whole cloud in evaluation: one thread for each `WORK_PER_THREAD` of points × weights
  (`thread_count`).
- A worker process: one thread.

The number never exceeds the caller's limit, which is `OMP_NUM_THREADS` or `torch.set_num_threads`, or else the number
of cores.
"""

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

WORK_PER_THREAD = 50_000_000
"""Points × weights for each thread, roughly the number of multiplications in a network's layers. With twice this work,
two threads are faster than one on a quiet machine and little slower on a busy one (benchmarks/test_threads.py).
"""
PASSIVE = {"OMP_WAIT_POLICY": "PASSIVE", "KMP_BLOCKTIME": "0"}
"""Environment variables that let waiting threads sleep. GNU's OpenMP (torch on Linux) reads the first, LLVM's and
Intel's (macOS, Windows) the second."""
WAIT_VARIABLES = (*PASSIVE, "GOMP_SPINCOUNT", "KMP_LIBRARY")
"""Environment variables that decide how threads wait. If one of them is set, none is changed."""

_lock = threading.Lock()
Result = TypeVar("Result")


class _OuterLimit(threading.local):
    """Number of threads before the outermost block of `threads` in the calling thread; None outside of such blocks."""

    count: int | None = None


_outer = _OuterLimit()


def thread_count(points: int, weights: int) -> int:
    """Return the number of threads for a network's forward or backward pass over a batch.

    Args:
        points: number of points of all clouds of the batch together.
        weights: number of weights of the network.
    """
    return max(1, points * weights // WORK_PER_THREAD)


def allowed() -> int:
    """Return the caller's limit on torch's threads, as it was before the outermost block of `threads`."""
    import torch

    return _outer.count or torch.get_num_threads()


@contextmanager
def threads(count: int) -> Iterator[int]:
    """Limit torch to `count` threads within a block, or within a function as its decorator.

    The old limit is restored at the end. Only the calling thread is affected. A limit is never raised: of nested
    blocks the smallest count applies.

    Args:
        count: at least 1.

    Yields:
        The number of threads in the block.
    """
    import torch

    with _lock:  # a thread that uses torch for the first time must not inherit a number that another is just setting
        before = torch.get_num_threads()
    outermost = _outer.count is None
    try:
        if outermost:
            _outer.count = before
        if count < before:
            _set_own(count)
        yield min(count, before)
    finally:
        if torch.get_num_threads() != before:
            _set_own(before)
        if outermost:
            _outer.count = None


def single_thread() -> None:
    """Limit torch to one thread in the calling thread, for good. Meant for parallel workers."""
    import torch

    if torch.get_num_threads() > 1:
        _set_own(1)


def _set_own(count: int) -> None:
    """Set the number of torch's threads for the calling thread only.

    `torch.set_num_threads` also sets the default of the process, which every thread inherits that uses torch for the
    first time. Such a thread would keep the number after the block has ended, so the default is restored.
    """
    import torch

    with _lock:
        default = _in_new_thread(torch.get_num_threads)
        torch.set_num_threads(count)
        if default != count:
            _in_new_thread(lambda: torch.set_num_threads(default))


def _in_new_thread(work: Callable[[], Result]) -> Result:
    results: list[Result] = []
    thread = threading.Thread(target=lambda: results.append(work()))
    thread.start()
    thread.join()
    return results[0]


def wait_passively() -> None:
    """Let waiting threads of this process and its children sleep, unless `WAIT_VARIABLES` are set already.

    OpenMP reads these variables when it is loaded: once torch is imported, only new processes are affected.
    """
    if not any(name in os.environ for name in WAIT_VARIABLES):
        os.environ.update(PASSIVE)
