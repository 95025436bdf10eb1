"""Tables 2 to 5 of the paper with numbers of ours, of the rows that are finished.

pcsr run table2; pcsr run table3; pcsr run table4; pcsr run table5
python benchmarks/paper_tables.py RUNS [--save]

Weights, error of each object and touch efficiency are those of `results.json` in each run folder; the paper's numbers
are those of the recipes, in brackets.
"""

from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import click
from rich.console import Console
from saved import save, show

from pcsr.errors import PcsrError
from pcsr.metrics.touch_effect import EFFICIENCY, EXCHANGED
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.report.tables.comparison import Comparison, Difference, comparison
from pcsr.report.tables.rows import SEED, Row
from pcsr.report.tables.scores import efficiency_cell
from pcsr.run_files import RESULTS, FinishedRun, read_results_of

Table = tuple[Sequence[str], list[list[str]]]
"""Names of the columns, and rows of cells."""
Found = dict[str, list[FinishedRun]]
"""The finished runs of each row of a study, one for each seed, in the order of the rows."""
COUNTS = range(6)
"""Numbers of touches in Table 4."""
USED = 4
"""Number of touches at which the rows of Table 4 are compared."""
TOUCH = {"none": "–", "iterative": "the paper's fusion", "edge-conv": "points kept", "joint-cloud": "points kept"}
"""What a network makes of touches, by the name of its fusion."""
ROWS4 = {
    "pu-transformer": "PU-Transformer alone",
    "raw": "touched points joined to its input",
    "control": "FE and FF blocks, trained and used without touch",
    "concat": "FE blocks, features concatenated",
    "tapsr": "TAPSR: FE and FF blocks",
    "tapsr-edge-conv": "ours: FE blocks, fusion `edge-conv`",
    "frames": "ours: `frames`",
}
"""Rows of Table 4 by the names in the recipe."""
DIFFERENCE = ("cd, difference", "share", "95 % interval", "p (Holm)", "better objects", "better seeds")
"""Columns of a paired difference, as `pcsr compare` computes it."""


@cache
def names(study: str) -> list[str]:
    """Return the names of a study's runs, with that of the study and the seed."""
    return [recipe.name for recipe in load(Path(study), load_plugins())]


def finished(runs: Path, study: str) -> Found:
    """Return the finished runs of a study. Rows that are not finished are missing."""
    found: Found = {}
    for full in names(study):
        name = SEED.sub("", full).removeprefix(f"{study}-")
        folders = [path.parent for path in runs.glob(f"{full}-????????/{RESULTS}")]
        if folders:  # of several the newest
            newest = max(folders, key=lambda folder: (folder / RESULTS).stat().st_mtime)
            found.setdefault(name, []).append(read_results_of(newest))
    return found


def compared(found: Found, study: str) -> tuple[Comparison, dict[str, Row]]:
    """Return the numbers of a study's runs, and its rows by name."""
    runs = [one.results for of_row in found.values() for one in of_row]
    made = comparison(runs, study)
    networks = made.rows[: len(found)]
    named = dict(zip(found, networks, strict=True))
    return made, named | {row.label: row for row in made.rows[len(found) :]}


def cell(row: Row, metric: str, *, over_seeds: bool = False) -> str:
    """Mean ± deviation, with the published value in brackets."""
    digits = 3 if metric == "cd" else 1
    spread = row.spread(metric, over_seeds=over_seeds)
    text = f"{row.mean(metric):.{digits}f}" + ("" if spread is None else f" ± {spread:.{digits}f}")
    return f"{text} ({row.published[metric]:g})" if metric in row.published else text


def last_quarter(run: FinishedRun) -> str:
    """How much the validation error fell in the last quarter of the training, in per cent of its value before."""
    lines = [line for line in run.history or () if "validation" in line]
    if not lines:
        return ""
    metric = next(iter(lines[-1]["validation"]))
    before = [line for line in lines if line["step"] <= 0.75 * lines[-1]["step"]]
    if not before:
        return ""
    # Means of an eighth of the training each: single validations scatter.
    width = max(1, len(lines) // 8)
    old, new = (
        sum(line["validation"][metric] for line in some[-width:]) / len(some[-width:]) for some in (before, lines)
    )
    return f"{100 * (new / old - 1):+.1f} %"


def table2(found: Found) -> Table:
    """A row for each network and kind of touch, then the baselines; ± over objects."""
    made, rows = compared(found, "table2")
    columns = ["network", "touch", "weights", *made.metrics, EFFICIENCY, EXCHANGED, "last quarter", "min"]
    lines = []
    for name, runs in found.items():
        training = runs[0].results.training
        lines.append(
            [
                name.partition("-touch")[0].removesuffix("-edge-conv"),
                TOUCH[runs[0].results.recipe["model"]["fusion"]["use"]],
                f"{rows[name].parameters / 1e3:,.0f} K",
                *(cell(rows[name], metric) for metric in made.metrics),
                efficiency_cell(rows[name].efficiencies or ()),
                efficiency_cell(rows[name].exchanged),
                last_quarter(runs[0]),
                "" if training.seconds is None else f"{training.seconds / 60:.0f}",
            ]
        )
    baselines = {name: row for name, row in rows.items() if name not in found}
    lines += [[name, *[""] * 2, *(cell(row, m) for m in made.metrics), *[""] * 4] for name, row in baselines.items()]
    return columns, lines


def table3(found: Found) -> Table:
    """A row for each rate."""
    _, rows = compared(found, "table3")
    lines = []
    for rate in sorted({runs[0].results.data.rate for runs in found.values()}):
        names = (f"pu-transformer-rate.{rate}", f"tapsr-rate.{rate}", f"midpoint {rate}×")
        lines.append([str(rate), *(cell(rows[name], "cd") if name in rows else "–" for name in names)])
    return ["rate", "PU-Transformer", f"TAPSR, {USED} touches", "midpoint"], lines


def table4(found: Found) -> Table:
    """A row for each network, a column for each number of touches; ± over seeds."""
    _, rows = compared(found, "table4")
    lines = []
    for row, text in ROWS4.items():
        names = [f"{row}-touches.{count}" for count in COUNTS]
        if not any(name in rows for name in names):
            continue
        cells = [cell(rows[name], "cd", over_seeds=True) if name in rows else "" for name in names]
        used = names[USED]
        lines.append([text, *cells, efficiency_cell(rows[used].efficiencies or ()) if used in rows else "–"])
    return ["", "no touch", "1 touch", *(f"{count} touches" for count in COUNTS[2:]), f"{EFFICIENCY} at {USED}"], lines


def table5(found: Found) -> Table:
    """Seconds of a training epoch and milliseconds of a cloud, a column for each number of touches."""
    _, rows = compared(found, "table5")
    each = [rows[name] for name in found]
    epochs = [f"{row.epoch:.1f} ({row.published['s/epoch']:g})" for row in each if row.epoch is not None]
    clouds = [f"{1e3 * row.seconds:.0f} ({1e3 * row.published['s/cloud']:g})" for row in each]
    return ["touches", *(str(row.runs[0].data.touches) for row in each)], [["s/epoch", *epochs], ["ms/cloud", *clouds]]


def grafts2(found: Found) -> Table:
    """Each network of Table 2 with touch minus the same one alone."""
    lines = []
    for alone in found:
        of_network = [name for name in (alone, f"{alone}-touch", f"{alone}-touch-edge-conv") if name in found]
        if "-touch" in alone or len(of_network) < 2:
            continue
        made, rows = compared({name: found[name] for name in of_network}, "table2")
        for name, difference in zip(of_network[1:], made.differences["cd"][1:], strict=False):
            touch = TOUCH[found[name][0].results.recipe["model"]["fusion"]["use"]]
            lines.append([alone, touch, *_cells(difference, rows[alone], rows[name])])
    return ["network", "touch", *DIFFERENCE], lines


def differences4(found: Found) -> Table:
    """Each row of Table 4 with four touches, or without if it has none, minus the control without touch."""
    order = ["control", *(row for row in ROWS4 if row != "control")]
    chosen = [name for row in order for name in (f"{row}-touches.{USED}", f"{row}-touches.0") if name in found]
    chosen = [name for name in chosen if not name.endswith("touches.0") or name[:-1] + str(USED) not in found]
    lines = []
    if chosen[:1] == ["control-touches.0"]:
        made, rows = compared({name: found[name] for name in chosen}, "table4")
        for name, difference in zip(chosen[1:], made.differences["cd"][1:], strict=False):
            lines.append([ROWS4[name.rpartition("-")[0]], *_cells(difference, rows[chosen[0]], rows[name])])
    return ["", *DIFFERENCE], lines


def _cells(difference: Difference | None, first: Row, row: Row) -> list[str]:
    """The cells of a paired difference from the first row."""
    if difference is None or difference.interval is None or difference.p_value is None:
        return [""] * len(DIFFERENCE)
    low, high = difference.interval
    share = f"{100 * difference.mean / first.mean('cd'):+.1f} %"
    seeds = "" if difference.better_seeds is None else f"{difference.better_seeds}/{len(row.seeds)}"
    wins = f"{difference.wins}/{len(row.of_objects('cd'))}"
    return [f"{difference.mean:+.3f}", share, f"[{low:+.3f}, {high:+.3f}]", f"{difference.p_value:.2g}", wins, seeds]


TABLES: dict[str, tuple[str, Callable[[Found], Table]]] = {
    "table-2": ("table2", table2),
    "table-2-grafts": ("table2", grafts2),
    "table-3": ("table3", table3),
    "table-4": ("table4", table4),
    "table-4-differences": ("table4", differences4),
    "table-5": ("table5", table5),
}
"""Each table by the name of its file: the study, and what makes the table of its runs."""


@click.command()
@click.argument("runs", type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.option("--save", "saving", is_flag=True, help="Write docs/numbers/table-2.json and so on.")
def main(runs: Path, saving: bool) -> None:
    """Print the tables of the runs in RUNS."""
    console = Console(stderr=True)
    try:
        for name, (study, make) in TABLES.items():
            found = finished(runs, study)
            columns, rows = make(found) if found else ((), [])
            if not rows:
                console.print(f"{name}: left out, as its runs in {runs} are not finished", soft_wrap=True)
                continue
            show(columns, rows, title=name)
            if saving:
                save(name, f"pcsr run {study}; python benchmarks/paper_tables.py runs --save", columns, rows)
    except PcsrError as error:
        raise click.ClickException(str(error)) from error


if __name__ == "__main__":
    main()
