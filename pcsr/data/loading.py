"""Batches made ahead by other processes, since one process alone is slower than a GPU."""

import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

from torch.utils.data import DataLoader, Dataset

from pcsr.data.batches import Batch, Batches
from pcsr.workers import end_with_parent

LOADERS = 2
"""Default number of processes that make batches for a GPU."""


def prepared(batches: Batches, steps: range, loaders: int, rank: int = 0, ranks: int = 1) -> Iterable[Batch]:
    """Return the share of process `rank` in each batch of `steps`, in their order.

    Args:
        batches: all batches of the run.
        steps: numbers of the batches.
        loaders: number of processes, of one thread each, that make batches ahead. 0: this process makes each batch when
            it is needed, which is as fast where the same CPU trains.
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
    """The data set that the loader indexes by step."""

    share: Callable[[int], Batch]

    def __getitem__(self, step: int) -> Batch:
        return self.share(step)


def _apart(_number: int) -> None:
    """Leave the process group, which receives SIGINT and SIGTERM: training ends its loaders after its last step."""
    if hasattr(os, "setpgid"):  # Windows has no process groups of this kind
        os.setpgid(0, 0)
    end_with_parent()  # torch checks for it only every five seconds
