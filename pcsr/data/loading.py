"""Data loading: batches are prepared ahead by other processes, since one process cannot keep a GPU busy."""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

from torch.utils.data import DataLoader, Dataset

from pcsr.data.batches import Batch, Batches
from pcsr.workers import end_with_parent

LOADERS = 2
"""Default number of processes that prepare batches for a GPU."""


def prepared(batches: Batches, steps: range, loaders: int, rank: int = 0, ranks: int = 1) -> Iterable[Batch]:
    """Iterate over the batches of `steps` in order, and return of each the share of process `rank`.

    Args:
        batches: all batches of the training, by step.
        steps: steps to iterate over.
        loaders: number of processes, with one thread each, that prepare batches. 0: each batch is prepared when it is
            requested, which is as fast for training on a CPU.
        rank: index of this process among those that train.
        ranks: number of processes that train.
    """
    share = partial(batches.at, rank=rank, ranks=ranks)
    if not loaders or not steps:
        return map(share, steps)
    return DataLoader(
        _Shares(share),
        batch_size=None,
        sampler=steps,
        num_workers=loaders,
        prefetch_factor=4,
        worker_init_fn=_apart,
    )


@dataclass(frozen=True)
class _Shares(Dataset[Batch]):
    """Map-style data set whose items are shares of batches."""

    share: Callable[[int], Batch]

    def __getitem__(self, step: int) -> Batch:
        return self.share(step)


def _apart(_number: int) -> None:
    """Move the loader to a process group of its own, since Ctrl-C signals a whole group.

    The training process handles the signal, finishes its step and ends its loaders.
    """
    if hasattr(os, "setpgid"):  # not on Windows
        os.setpgid(0, 0)
    end_with_parent()  # torch checks for the parent only every five seconds
