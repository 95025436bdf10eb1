"""Options of a run: device, processes, folders, and the treatment of existing weights."""

from dataclasses import dataclass
from pathlib import Path

from pcsr.recipe import Recipe


@dataclass(frozen=True)
class RunOptions:
    """Options of a run that are not part of its recipe."""

    runs: Path = Path("runs")
    """Folder of the run folders."""
    device: str = "auto"
    """`cpu`, `cuda`, or `auto`: CUDA if it is available."""
    devices: int = 1
    """Devices of each node; training starts one process for each."""
    nodes: int = 1
    """Machines."""
    jobs: int | None = None
    """Processes for data and metrics, by default one for each core; also for the batches of all GPUs, by default two
    for each GPU."""
    data: tuple[Path, ...] = ()
    """Folders of built data. The recipe must name this data, as after `BuiltData.replace_data`."""
    keep_weights: bool = False
    """Whether weights that were trained before the code of a part changed are evaluated, instead of training again."""
    retrain: bool = False
    """Whether the network is trained although finished weights exist. They are replaced when training is finished."""
    reevaluate: bool = False
    """Whether the network is evaluated although finished results exist."""
    command: str | None = None
    """Command line, for the record in the run folder."""


def run_folder(recipe: Recipe, options: RunOptions) -> Path:
    """Return the run folder of a recipe. Equal recipes have the same folder, different recipes different ones."""
    return options.runs / f"{recipe.name}-{recipe.fingerprint[:8]}"
