"""The run folders of a study, and what is kept of them in benchmarks/results."""

from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

from rich.console import Console

from pcsr.files import write_text
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import Recipe, load
from pcsr.report.tables.rows import SEED

KEPT = Path(__file__).parent / "results"
"""Numbers of the trainings that the pages tell of, without their weights, in folders named as the run folders."""


@cache
def recipes(study: str) -> list[Recipe]:
    """Return the recipes of a study, one for each row and seed."""
    return load(Path(study), load_plugins())


def row_of(recipe: Recipe) -> str:
    """Return the name of a run's row: that of the run without those of the study and the seed."""
    return SEED.sub("", recipe.name).partition("-")[2]


def folders(runs: Path, study: str) -> Iterator[tuple[Recipe, Path]]:
    """Find the run folders of a study by the names and fingerprints of its recipes, finished or not.

    Folders of its rows with other settings, such as fewer epochs, are left out and named on standard error.

    Args:
        runs: folder of the run folders.
        study: name of the study's recipe.

    Yields:
        Recipe and run folder, in the order of the study.
    """
    console = Console(stderr=True)
    for recipe in recipes(study):
        own = f"-{recipe.fingerprint[:8]}"
        names = (recipe.name, SEED.sub("", recipe.name))  # with a single seed, the name has none
        found = [runs / f"{name}{own}" for name in names if (runs / f"{name}{own}").is_dir()]
        if found:
            yield recipe, found[0]
        for path in sorted(runs.glob(f"{recipe.name}-????????")):
            if not path.name.endswith(own):
                console.print(f"{path}: left out, as its settings are not those of {study}", soft_wrap=True)


def keep(folder: Path, texts: Mapping[str, str]) -> None:
    """Write files of a run folder to benchmarks/results, in place of those that are there.

    Args:
        folder: the run folder.
        texts: the files' content by their names.
    """
    (KEPT / folder.name).mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        write_text(KEPT / folder.name / name, text)
