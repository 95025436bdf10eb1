"""Data of a run: loaded from folders, or built if it does not exist yet."""

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

QUIET_SIZE = 1 << 28
"""Size of a split in bytes up to which no progress is shown: it is read and hashed in about a second."""
Data = Callable[[str, Progress], Split]
"""Function that returns a split by its name, after building it if it does not exist yet."""


def data_of(
    recipe: Recipe, registry: Registry, runs: Path, folders: tuple[Path, ...] = (), jobs: int | None = None
) -> tuple[str, Data]:
    """Return the fingerprint of a recipe's data, and the function that returns its splits.

    Args:
        recipe: recipe to run.
        registry: parts that build the data.
        runs: folder of the run folders. Data is built in its subfolder `data`.
        folders: folders of data that is built already. Without any, the recipe's data is built.
        jobs: number of processes that build; all cores by default.

    Raises:
        UserError: a folder cannot be read, or the recipe uses joined folders and they are not given.
    """
    if folders:
        built = BuiltData.read(folders)
        return built.fingerprint, lambda split, progress: _checked(built, split, progress)
    if recipe.joined:
        raise UserError(
            f"recipe '{recipe.name}' uses {len(recipe.joined)} joined data sets: give the folder of each with --data, "
            f"or remove `joined`"
        )
    plan = Plan.of(recipe, registry)

    def load(split: str, progress: Progress) -> Split:
        names = plan.split(split)
        task = progress.add_task(f"{split} data", total=len(names))
        folder = runs / "data" / plan.fingerprint[:12]
        with worker_pool(jobs) as workers:
            return load_or_build(plan, split, folder, workers, lambda count: progress.advance(task, count))

    return plan.fingerprint, load


def _checked(built: BuiltData, split: str, progress: Progress) -> Split:
    """Load a split of data that is built already, with a progress bar if it is large."""
    if sum(path.stat().st_size for path in built.shards(split) if path.is_file()) < QUIET_SIZE:
        return built.split(split)
    task = progress.add_task(f"checking the {split} data", total=built.objects(split))
    return built.split(split, lambda count: progress.advance(task, count))
