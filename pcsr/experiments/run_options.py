"""Options of a run: where it computes, what it reads and where it writes."""

from dataclasses import dataclass
from pathlib import Path

from pcsr.recipe import Recipe


@dataclass(frozen=True)
class RunOptions:
    """How a recipe is run: device, processes, folders, and what becomes of old weights."""

    runs: Path = Path("runs")
    device: str = "auto"
    devices: int = 1
    nodes: int = 1
    jobs: int | None = None
    """Processes for data and metrics, all cores by default; and for the batches of all GPUs, two each by default."""
    data: tuple[Path, ...] = ()
    """Folders of data that is built already; the recipe must be on them, as `BuiltData.replace_data` makes it."""
    keep_weights: bool = False
    """Weights that were trained before the code of a part changed are measured, instead of training again."""
    retrain: bool = False
    """The network is trained anew, whatever finished weights there are; they stay until the new ones are finished."""


def run_folder(recipe: Recipe, options: RunOptions) -> Path:
    """The folder of a recipe: the same recipe comes back to it, another never does."""
    return options.runs / f"{recipe.name}-{recipe.fingerprint[:8]}"
