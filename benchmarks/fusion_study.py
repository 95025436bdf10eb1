"""What the rows of pcsr/recipes/fusions/study.yaml make of touches, over the steps of their training.

pcsr run fusions/study
python benchmarks/fusion_study.py RUNS [-o docs/pictures] [--save]

Each snapshot (`train.snapshots`) is measured on all test objects: without touch, with touches, and with those of
another object. The numbers are kept in the run's folder (`snapshots.json`), so that the command measures only what is
new. Rows that are still in training are shown as far as they are. `--save` copies the numbers to benchmarks/results,
and makes tables and picture of all that are there.
"""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import click
import numpy as np
import torch
from rich.console import Console
from rich.progress import track
from saved import save, show
from study_runs import KEPT, folders, keep, row_of
from study_snapshots import MEASURED, Numbers, measured

from pcsr.errors import PcsrError, UserError
from pcsr.metrics.touch_effect import EFFICIENCY, efficiency
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Registry
from pcsr.report.figures.line_chart import Line, line_chart
from pcsr.report.tables.scores import efficiency_cell

STUDY = "fusions/study"
Rows = dict[str, dict[int, list[Numbers]]]
"""Row to step to the numbers of each seed."""
COLUMNS = ("row", "seeds", "step", "cd without touch", "with touches", "with another object's", EFFICIENCY)
COLUMNS += (f"{EFFICIENCY} of another object's", "change of the result by touch", "cd with another object's features")


def read(runs: Path, registry: Registry, *, keeping: bool = False) -> Rows:
    """Measure the study's runs, in the order of its rows.

    Args:
        runs: folder of the run folders.
        registry: installed parts.
        keeping: also copy the numbers of each run to benchmarks/results.

    Raises:
        UserError: there are no snapshots, or the test data are not in RUNS/data.
    """
    rows: Rows = defaultdict(lambda: defaultdict(list))
    found = list(folders(runs, STUDY))
    for recipe, folder in track(found, "measuring", console=Console(stderr=True), transient=True):
        by_step = measured(folder, recipe.train.snapshots, registry)
        for step, numbers in by_step.items():
            rows[row_of(recipe)][step].append(numbers)
        if keeping and by_step:
            keep(folder, {MEASURED: (folder / MEASURED).read_text(encoding="utf-8")})
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
        rows = read(runs, load_plugins(), keeping=saving)
        if saving:
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
