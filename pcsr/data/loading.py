"""Batches made ahead by other processes: a GPU is done with one before a single process has made the next."""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

from torch.utils.data import DataLoader, Dataset

from pcsr.data.batches import Batch, Batches
from pcsr.workers import end_with_parent

LOADERS = 2
"""Processes that make batches for a GPU, if nobody says how many."""


def prepared(batches: Batches, steps: range, loaders: int, rank: int = 0, ranks: int = 1) -> Iterable[Batch]:
    """The share of process `rank` in each batch of `steps`, in their order.

    Args:
        batches: all of them, by number.
        steps: which of them.
        loaders: processes, of a thread each, that make them; 0 makes each when it is asked for. Beside a CPU that
            trains nothing is gained by more.
        rank: the number of this process among those that train.
        ranks: how many train.
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
    """What a loader asks for an item."""

    share: Callable[[int], Batch]

    def __getitem__(self, step: int) -> Batch:
        return self.share(step)


def _apart(_number: int) -> None:
    """Ctrl-C and a scheduler's polite kill go to a whole process group; training ends its step, then its loaders."""
    if hasattr(os, "setpgid"):  # Windows has no process groups of this kind
        os.setpgid(0, 0)
    end_with_parent()  # torch looks for it every five seconds only
