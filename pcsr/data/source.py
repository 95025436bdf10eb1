"""The data of a run: read and checked from folders, or built where it isn't there yet."""

from collections.abc import Callable
from pathlib import Path

from rich.progress import Progress

from pcsr.data.build import load_or_build
from pcsr.data.built import BuiltData
from pcsr.data.dataset import Split
from pcsr.data.plan import Plan
from pcsr.errors import UserError
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe
from pcsr.workers import worker_pool

MOMENT = 1 << 28
"""Bytes that are read and hashed in about a second."""
Data = Callable[[str, Progress], Split]
"""Gives a split of the data, which it builds first where it isn't there yet."""


def data_of(
    recipe: Recipe, registry: Registry, runs: Path, folders: tuple[Path, ...] = (), jobs: int | None = None
) -> tuple[str, Data]:
    """The fingerprint of a recipe's data, and the function that gives its splits.

    Args:
        recipe: as it is run.
        registry: gives the parts that make the data.
        runs: where run folders are; data that is built is kept beside them, in `data/`.
        folders: of data that is built already; without any it is built here.
        jobs: processes that build; all cores by default.

    Raises:
        UserError: a folder cannot be read, or the recipe is on folders that are not named.
    """
    if folders:
        built = BuiltData.read(folders)
        return built.fingerprint, lambda split, progress: _checked(built, split, progress)
    if recipe.joined:
        raise UserError(
            f"recipe '{recipe.name}' is on {len(recipe.joined)} data sets that were joined: name their folders, each "
            f"with --data, or remove `joined`"
        )
    plan = Plan.of(recipe, registry)

    def load(split: str, progress: Progress) -> Split:
        names = plan.split(split)
        task = progress.add_task(f"building the {split} data", total=len(names))
        folder = runs / "data" / plan.fingerprint[:12]
        with worker_pool(jobs) as workers:
            return load_or_build(plan, split, folder, workers, lambda count: progress.advance(task, count))

    return plan.fingerprint, load


def _checked(built: BuiltData, split: str, progress: Progress) -> Split:
    """A split of data that is built already; reading and checking it is shown where it takes longer than a moment."""
    if sum(path.stat().st_size for path in built.shards(split) if path.is_file()) < MOMENT:
        return built.split(split)
    task = progress.add_task(f"checking the {split} data", total=built.objects(split))
    return built.split(split, lambda count: progress.advance(task, count))
