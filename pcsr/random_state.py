"""Random states that all code of a process shares: those of torch, numpy and Python.

pcsr itself draws from generators of its own. Networks of others and parts, such as those with dropout, draw from the
shared states.
"""

import random
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
import torch


@contextmanager
def seeded(seed: Sequence[int], device: torch.device | None = None) -> Iterator[None]:
    """Seed the shared random states within a block, and restore them afterwards.

    Args:
        seed: numbers from 0 to 2³² - 1. A single one is the seed itself; several are mixed.
        device: device that random numbers are drawn on, besides the CPU.

    Examples:
        >>> with seeded([0]):
        ...     one = torch.rand(3), np.random.rand(3)
        >>> with seeded([0]):
        ...     other = torch.rand(3), np.random.rand(3)
        >>> torch.equal(one[0], other[0]), (one[1] == other[1]).all()
        (True, True)
    """
    number = seed[0] if len(seed) == 1 else int(np.random.SeedSequence(seed).generate_state(1)[0])
    devices = [device] if device is not None and device.type == "cuda" else []
    of_python, of_numpy = random.getstate(), np.random.get_state()  # noqa: NPY002 code of others uses it
    with torch.random.fork_rng(devices):
        torch.manual_seed(number)
        random.seed(number)
        np.random.seed(number)  # noqa: NPY002
        try:
            yield
        finally:
            random.setstate(of_python)
            np.random.set_state(of_numpy)  # noqa: NPY002
