"""Batches of clouds and touches for a training loop of one's own."""

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, get_args

from jaxtyping import Float
from rich.console import Console
from torch import Tensor

from pcsr.contracts import SPLITS
from pcsr.data.batches import Batches, usable
from pcsr.data.built import BuiltData
from pcsr.data.dataset import Split
from pcsr.data.source import data_of
from pcsr.errors import UserError, did_you_mean
from pcsr.plugins.loading import check_loaded, load_plugins, plugin_paths
from pcsr.progress import progress_bars
from pcsr.recipe import Patches, load
from pcsr.recipe.train_section import Augmentation, Train
from pcsr.tensors import Points, TouchMask, TouchPoints

DEFAULT_AUGMENT: tuple[str, ...] = Train.model_fields["augment"].default
"""Augmentations of recipes that name none."""


class TrainingBatch(NamedTuple):
    """Clouds and their touches, in the frame in which each sparse cloud fills the unit sphere before augmentation."""

    points: Points
    """Sparse clouds, (b n 3)."""
    touches: TouchPoints
    """Touched points, (b a m 3)."""
    mask: TouchMask
    """Which touches are present, (b a)."""
    truth: Float[Tensor, "b g 3"]
    """True dense clouds, (b g 3)."""


class Loader:
    """Loader of batches for a training loop: points, touches, mask and truth.

    Each iteration over it is an epoch, with the objects in another order. The batches are those that `pcsr run` trains
    on: they depend on the seed and the epoch alone.

    Args:
        data: folder that `pcsr data make` built, or several; or a recipe, by name or file, whose data are built in
            `runs/data` unless they are there.
        split: "train", "validation" or "test".
        batch: number of clouds in a batch.
        touches: number of touches of a cloud, or the least and the greatest, between which it is drawn for each batch.
            By default as many as the data have.
        patches: number of points of a patch and its rate, such as (256, 4), to train on patches. By default on whole
            clouds.
        augment: names of augmentations, as `train.augment` in a recipe.
        seed: seed of the batches.
        plugins: Python files with parts that the recipe names.
        jobs: number of processes that build the data of a recipe. More than one import the script again, whose
            statements must then be under `if __name__ == "__main__":`.

    Raises:
        UserError: there are no such data, or not as many touches; or an unknown augmentation.

    Examples:
        >>> loader = pcsr.Loader("smoke", batch=4, touches=2)
        >>> len(loader)
        8
        >>> points, touches, mask, truth = next(iter(loader))
        >>> points.shape, touches.shape, mask.shape, truth.shape
        (torch.Size([4, 128, 3]), torch.Size([4, 2, 64, 3]), torch.Size([4, 2]), torch.Size([4, 512, 3]))
    """

    def __init__(
        self,
        data: str | Path | Sequence[str | Path],
        split: str = "train",
        *,
        batch: int = 8,
        touches: int | tuple[int, int] | None = None,
        patches: tuple[int, int] | None = None,
        augment: Sequence[str] = DEFAULT_AUGMENT,
        seed: int = 0,
        plugins: Sequence[str | Path] = (),
        jobs: int = 1,
    ) -> None:
        for name in augment:
            if name not in get_args(Augmentation):
                raise UserError(f"augmentation {name!r} is unknown: {did_you_mean(name, get_args(Augmentation))}")
        if batch < 1:
            raise UserError(f"batch is {batch}: it must be at least 1")
        if not 0 <= seed < 2**32:
            raise UserError(f"seed is {seed}: it must be 0 or more, and less than {2**32}")
        loaded, sampling, most = _loaded([data] if isinstance(data, str | Path) else data, split, plugins, jobs)
        low, high = (touches, touches) if isinstance(touches, int) else touches or (most, most)
        if not 0 <= low <= high <= most:
            raise UserError(f"touches is {touches}: the data have {most} of each object, so give 0 to {most}")
        self.epoch = 0
        """Number of epochs so far; set it to continue a training."""
        self._batches = Batches(
            loaded,
            min(batch, len(loaded)),
            (low, high),
            usable(augment, sampling),
            seed,
            None if patches is None else Patches(points=patches[0], rate=patches[1]),
        )

    def __len__(self) -> int:
        """Number of batches in an epoch."""
        return self._batches.per_epoch

    def __iter__(self) -> Iterator[TrainingBatch]:
        """Yield the batches of the next epoch."""
        epoch, self.epoch = self.epoch, self.epoch + 1
        for step in range(epoch * len(self), (epoch + 1) * len(self)):
            batch = self._batches.at(step)
            yield TrainingBatch(batch.points, batch.touches.points, batch.touches.mask, batch.truth)


def _loaded(data: Sequence[str | Path], split: str, plugins: Sequence[str | Path], jobs: int) -> tuple[Split, str, int]:
    """Load or build a split; return it with its sampling and its number of touches."""
    folders = [Path(one) for one in data]
    if len(folders) > 1 or os.path.isdir(folders[0]):
        built = BuiltData.read(folders)
        samplings = {manifest.data.sampling for manifest in built.manifests}
        most = min(manifest.data.touches for manifest in built.manifests)
        return built.split(split), samplings.pop() if len(samplings) == 1 else "mixed", most
    registry = load_plugins(plugin_paths(plugins))
    check_loaded(registry)
    recipes = load(folders[0], registry)
    if len(recipes) != 1:
        raise UserError(f"{folders[0]} describes {len(recipes)} runs: give a recipe of one, or a folder of data")
    (recipe,) = recipes
    if split not in SPLITS:
        raise UserError(f"split is {split!r}: {did_you_mean(str(split), SPLITS)}")
    with progress_bars(Console(stderr=True), hidden=False) as progress:
        loaded = data_of(recipe, registry, Path("runs"), jobs=jobs)[1](split, progress)
    return loaded, recipe.data.sampling, recipe.most_touches
