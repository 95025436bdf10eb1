"""How many threads torch computes with: as many as an operation's size deserves, within what the caller allows.

The threads of one operation meet at its end. On a busy machine one of them may be off the processor then, and the
others wait for it, in each of some thousand small operations; by default they wait spinning, which keeps the processor
from the one that is waited for. So the number follows from the work alone, never from the load: results do not depend
on what else a machine does.

- A patch of `densify`, a metric, a check of a plugin: one thread. What makes them faster is processes (`jobs`).
- A batch that is trained on, and a cloud that evaluation gives a network whole: a thread for each `EACH` points ×
  weights of the network (`deserved`).
- A worker process: one.

None gets more than the caller lets torch have, by `OMP_NUM_THREADS` or `torch.set_num_threads`; all cores if neither
was set.
"""

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

EACH = 50_000_000
"""Points × weights, about the multiplications of a network's layers, that deserve a thread. From two of them on two
threads take less time than one on a quiet machine, and not much more beside busy processes
(benchmarks/test_threads.py).
"""
PASSIVE = {"OMP_WAIT_POLICY": "PASSIVE", "KMP_BLOCKTIME": "0"}
"""Environment of threads that sleep while they wait: GNU's OpenMP (torch on Linux) reads the first, LLVM's and Intel's
(macOS, Windows) the second."""
WAITING = (*PASSIVE, "GOMP_SPINCOUNT", "KMP_LIBRARY")
"""What a person may have set about waiting."""

_SETTING = threading.Lock()
Found = TypeVar("Found")


class _Outside(threading.local):
    """What the calling thread had before the outermost block that it is in; None outside of all."""

    count: int | None = None


_outside = _Outside()


def deserved(points: int, weights: int) -> int:
    """The number of threads for a network's pass over a batch, forward or forward and backward.

    Args:
        points: of all clouds of the batch together.
        weights: of the network.
    """
    return max(1, points * weights // EACH)


def allowed() -> int:
    """The number of threads that the caller lets torch have; in a block of `threads`, outside of the outermost one."""
    import torch

    return _outside.count or torch.get_num_threads()


@contextmanager
def threads(count: int) -> Iterator[int]:
    """Limit torch to `count` threads in a block, or as a decorator in a function; what the caller had comes back.

    It acts on the calling thread alone, and never raises a number: of nested blocks the strictest counts.

    Args:
        count: at least 1.

    Yields:
        The number that torch has in the block.
    """
    import torch

    with _SETTING:  # a thread that uses torch for the first time must not begin with what another one is setting
        before = torch.get_num_threads()
    outermost = _outside.count is None
    try:
        if outermost:
            _outside.count = before
        if count < before:
            _set_own(count)
        yield min(count, before)
    finally:
        if torch.get_num_threads() != before:
            _set_own(before)
        if outermost:
            _outside.count = None


def single_thread() -> None:
    """Give the calling thread one torch thread from now on: for threads and processes that work beside others."""
    import torch

    if torch.get_num_threads() > 1:
        _set_own(1)


def _set_own(count: int) -> None:
    """Set the calling thread's number alone.

    `torch.set_num_threads` sets that and, for the whole process, the number of each thread that uses torch for the
    first time from then on. Those would keep it when the block is long over, so that one is put back.
    """
    import torch

    with _SETTING:
        first = _in_new_thread(torch.get_num_threads)
        torch.set_num_threads(count)
        if first != count:
            _in_new_thread(lambda: torch.set_num_threads(first))


def _in_new_thread(work: Callable[[], Found]) -> Found:
    found: list[Found] = []
    thread = threading.Thread(target=lambda: found.append(work()))
    thread.start()
    thread.join()
    return found[0]


def wait_passively() -> None:
    """Let threads of this process and of those it starts sleep while they wait, unless the environment says otherwise.

    OpenMP reads it when it is loaded: in a process that has imported torch it changes nothing but what is started.
    """
    if not any(name in os.environ for name in WAITING):
        os.environ.update(PASSIVE)
