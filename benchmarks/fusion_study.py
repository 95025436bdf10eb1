"""What the rows of pcsr/recipes/fusions/study.yaml make of touches, over the steps of their training.

pcsr run fusions/study
python benchmarks/fusion_study.py RUNS [-o docs/pictures] [--save]

Each snapshot (`train.snapshots`) is measured on all test objects: without touch, with touches, and with those of
another object. The numbers are kept in the run's folder (`snapshots.json`), so that the command measures only what is
new. Rows that are still in training are shown as far as they are. `--save` copies the numbers to benchmarks/results,
and makes tables and picture of all that are there.
"""

import json
from collections import defaultdict
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Self

import click
import numpy as np
import torch
from pydantic import BaseModel, Field, FiniteFloat, TypeAdapter, ValidationError, model_validator
from rich.console import Console
from rich.progress import track
from saved import save, show
from study_runs import KEPT, folders, keep, row_of

from pcsr.data.dataset import Split
from pcsr.data.sample import covered_points
from pcsr.errors import PcsrError, UserError
from pcsr.files import write_text
from pcsr.metrics.chamfer import chamfer
from pcsr.metrics.touch_effect import EFFICIENCY, efficiency, replace_region
from pcsr.network.load import load_weights
from pcsr.network.network import Network
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe
from pcsr.report.figures.line_chart import Line, line_chart
from pcsr.report.tables.scores import efficiency_cell
from pcsr.run_files import snapshot_file
from pcsr.tensors import CloudArray
from pcsr.upsample import upsample_as
from pcsr.validation_messages import explained
from pcsr.weights.file import read_card

STUDY = "fusions/study"
MEASURED = "snapshots.json"
Numbers = Mapping[str, Annotated[list[FiniteFloat], Field(min_length=1)]]
"""Chamfer distance of each test object: `without` touch, with its `own` touches, with those of an `other` object, and
`replaced`: without touch, the touched region replaced by the truth. `moved` is that of the network's own two results,
without touch and with touches. `features` is without touch, with the encoder's features of another object."""
NAMES = ("without", "own", "other", "replaced", "moved", "features")
"""What is measured of each object."""


class Measured(BaseModel):
    """The numbers of a snapshot."""

    sha256: str
    """Hash of its weights."""
    cd: Numbers

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if set(self.cd) != set(NAMES) or len({len(each) for each in self.cd.values()}) > 1:
            raise ValueError(f"it must have {', '.join(NAMES)}, each of all objects")
        return self


FILE = TypeAdapter(dict[str, Measured])
"""The numbers of a run's snapshots, by the names of their files."""
Rows = dict[str, dict[int, list[Numbers]]]
"""Row to step to the numbers of each seed."""
COLUMNS = ("row", "seeds", "step", "cd without touch", "with touches", "with another object's", EFFICIENCY)
COLUMNS += (f"{EFFICIENCY} of another object's", "change of the result by touch", "cd with another object's features")


def measure(network: Network, recipe: Recipe, split: Split) -> Numbers:
    """Upsample each object of a split without touch, with its touches and with those of the next object.

    Without touch it is also upsampled with the encoder's features of the next object, which shows whether the network
    uses features at all.
    """
    numbers: dict[str, list[float]] = {name: [] for name in NAMES}
    touches = [list(some[: recipe.data.touches].numpy()) for some in split.touches]
    features: list[torch.Tensor] = []
    with network.encoder.register_forward_hook(lambda module, given, made: features.append(made)):
        without = [_dense(network, recipe, points, []) for points in split.points]
    for i, truth in enumerate(split.truth):
        following = (i + 1) % len(split)
        clouds = {"without": without[i]}
        for name, some in (("own", touches[i]), ("other", touches[following])):
            clouds[name] = _dense(network, recipe, split.points[i], some)
        of_other = features[following]
        with network.encoder.register_forward_hook(lambda module, given, made, of_other=of_other: of_other):
            clouds["features"] = _dense(network, recipe, split.points[i], [])
        region = torch.from_numpy(covered_points(truth.numpy(), touches[i]).any(0))
        clouds["replaced"] = replace_region(clouds["without"], truth, region)
        for name, cloud in clouds.items():
            numbers[name].append(_error(cloud, truth))
        numbers["moved"].append(_error(clouds["own"], clouds["without"]))
    return numbers


def _error(cloud: torch.Tensor, truth: torch.Tensor) -> float:
    """Chamfer distance, to the digits that a file needs."""
    return float(f"{float(chamfer(cloud[None], truth[None])[0]):.6g}")


def _dense(network: Network, recipe: Recipe, points: torch.Tensor, touches: Sequence[CloudArray]) -> torch.Tensor:
    """Upsample a cloud as the recipe does."""
    return torch.from_numpy(upsample_as(recipe, network, points.numpy(), touches)).float()


def measured(folder: Path, steps: Sequence[int], registry: Registry) -> dict[int, Numbers]:
    """Return the numbers of a run's snapshots by step, after measuring those that are new.

    Numbers stay when the weights are removed.

    Raises:
        UserError: the file of the numbers is malformed.
    """
    path = folder / MEASURED
    known = _known(path)
    by_step = {}
    for step in steps:
        weights = folder / snapshot_file(step)
        entry = known.get(weights.name)
        card = read_card(weights) if weights.exists() else None
        if card is not None and (entry is None or entry.sha256 != card["sha256"]):
            network, recipe, _ = load_weights(weights, registry)
            split = _test_split(folder.parent / "data" / card["data_fingerprint"][:12])
            known[weights.name] = entry = Measured(sha256=card["sha256"], cd=measure(network, recipe, split))
            write_text(path, FILE.dump_json(known).decode())
        if entry is not None:
            by_step[step] = entry.cd
    return by_step


def _known(path: Path) -> dict[str, Measured]:
    """Read the numbers that a run's folder has; none without the file.

    Raises:
        UserError: the file is malformed.
    """
    if not path.exists():
        return {}
    try:
        return FILE.validate_python(json.loads(path.read_bytes()))
    except ValueError as error:
        first = error.errors()[:1] if isinstance(error, ValidationError) else []
        what = ": ".join([*map(str, first[0]["loc"]), explained(first)]) if first else f"it is no JSON ({error})"
        raise UserError(f"{path}: {what}; remove the file, and the snapshots are measured again") from error


@cache
def _test_split(folder: Path) -> Split:
    return Split.load(folder, "test")


def read(runs: Path, registry: Registry) -> Rows:
    """Measure the study's runs, in the order of its rows.

    Raises:
        UserError: there are no snapshots, or the test data are not in RUNS/data.
    """
    rows: Rows = defaultdict(lambda: defaultdict(list))
    found = list(folders(runs, STUDY))
    for recipe, folder in track(found, "measuring", console=Console(stderr=True), transient=True):
        for step, numbers in measured(folder, recipe.train.snapshots, registry).items():
            rows[row_of(recipe)][step].append(numbers)
    if not rows:
        raise UserError(f"{runs} holds no snapshot of the study: `pcsr run fusions/study --runs {runs}` makes some")
    return dict(rows)


def shares(seeds: Sequence[Numbers], touched: str = "own") -> list[float]:
    """Touch efficiency of each seed, with an object's own touches or with those of the other one."""
    found = [efficiency(numbers[touched], numbers["without"], numbers["replaced"]) for numbers in seeds]
    return [share for share in found if share is not None]


def means(seeds: Sequence[Numbers], name: str) -> list[float]:
    """Mean Chamfer distance of each seed, times 10³."""
    return [1e3 * float(np.mean(numbers[name])) for numbers in seeds]


def table(rows: Rows) -> list[list[str]]:
    """A line for each row: the last step that all its seeds have reached, mean ± standard deviation over seeds."""
    lines = []
    for row, by_step in rows.items():
        most = max(map(len, by_step.values()))
        step = max(step for step, seeds in by_step.items() if len(seeds) == most)
        seeds = by_step[step]
        cells = [efficiency_cell(means(seeds, name)) for name in ("without", "own", "other")]
        cells += [efficiency_cell(shares(seeds, name)) for name in ("own", "other")]
        cells += [efficiency_cell(means(seeds, name)) for name in ("moved", "features")]
        lines.append([f"`{row}`", str(len(seeds)), f"{step:,}", *cells])
    return lines


def over_steps(rows: Rows) -> list[list[str]]:
    """Touch efficiency of each row at each step."""
    steps = sorted({step for by_step in rows.values() for step in by_step})
    return [
        ["row", *(f"{step:,}" for step in steps)],
        *([f"`{row}`", *(efficiency_cell(shares(of.get(step, []))) for step in steps)] for row, of in rows.items()),
    ]


def draw(rows: Rows, path: Path) -> None:
    """Draw the touch efficiency over the steps, a line for each row, with a band of the deviation over seeds."""
    steps = sorted({step for by_step in rows.values() for step in by_step})
    lines: dict[str, Line] = {}
    for row, by_step in rows.items():
        found = [shares(by_step.get(step, [])) for step in steps]
        spread = [float(np.std(one, ddof=1)) if len(one) > 1 else np.nan for one in found]
        lines[row] = ([float(np.mean(one)) if one else np.nan for one in found], spread)
    line_chart("What fusions make of touches", "steps of training", EFFICIENCY, steps, lines, path)


@click.command()
@click.argument("runs", type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.option("-o", "--out", type=click.Path(path_type=Path), help="Draw fusion-study.png into this folder.")
@click.option("--save", "saving", is_flag=True, help="Write benchmarks/results and docs/numbers/fusion-study.json.")
def main(runs: Path, out: Path | None, saving: bool) -> None:
    """Print the tables of the study in RUNS."""
    torch.set_num_threads(1)
    try:
        if out is not None and out.exists() and not out.is_dir():
            raise UserError(f"-o {out}: it is a file; name a folder")
        rows = read(runs, load_plugins())
        if saving:
            for _, folder in folders(runs, STUDY):
                if (folder / MEASURED).exists():
                    keep(folder, {MEASURED: (folder / MEASURED).read_text(encoding="utf-8")})
            rows = read(KEPT, load_plugins())
        lines = table(rows)
        show(COLUMNS, lines)
        heads, *cells = over_steps(rows)
        show(heads, cells, title=f"{EFFICIENCY} over the steps of training")
        if out is not None:
            draw(rows, out / "fusion-study.png")
            click.echo(str(out / "fusion-study.png"))
        if saving:
            save(
                "fusion-study", "pcsr run fusions/study; python benchmarks/fusion_study.py runs --save", COLUMNS, lines
            )
    except PcsrError as error:
        raise click.ClickException(str(error)) from error


if __name__ == "__main__":
    main()
