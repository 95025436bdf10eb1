"""Tables 2 to 5 of the paper with numbers of ours, of the rows that are finished.

pcsr run table2; pcsr run table3; pcsr run table4; pcsr run table5
python benchmarks/paper_tables.py RUNS [--save]

Weights, error of each object and touch efficiency are those of `results.json` in each run folder; the paper's numbers
are those of the recipes, in brackets. `--save` copies the results to benchmarks/results, and makes the tables of all
that are there.
"""

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import fmean

import click
from inserted_touches import MEASURED, inserted
from rich.console import Console
from saved import save, show
from study_runs import KEPT, folders, keep, row_of

from pcsr.errors import PcsrError, UserError
from pcsr.metrics.touch_effect import EFFICIENCY, EXCHANGED
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Registry
from pcsr.report.tables.comparison import Comparison, comparison
from pcsr.report.tables.rows import Row
from pcsr.report.tables.scores import efficiency_cell
from pcsr.results import read_results
from pcsr.run_files import HISTORY, RESULTS, FinishedRun, read_history
from pcsr.weights import WEIGHTS

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
ALONE = dict.fromkeys(("tapsr", "tapsr-edge-conv"), "pu-transformer")
"""Rows of Table 2 that are compared with a network of another name."""
INSERTED = "-inserted"
"""End of the names of networks whose result gets the touched points afterwards."""
CONTROL = "control-touches.0"
"""Row of Table 4 with both blocks, trained without touch."""
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


def finished(runs: Path, study: str) -> Found:
    """Return the finished runs of a study. Rows that are not finished are missing."""
    found: Found = {}
    for recipe, folder in folders(runs, study):
        if (folder / RESULTS).exists():
            run = FinishedRun(folder, read_results(folder / RESULTS), [], read_history(folder / HISTORY))
            found.setdefault(row_of(recipe), []).append(run)
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
    lines = [line for line in run.history or () if line.get("validation")]
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


def content(run: FinishedRun) -> dict[str, str]:
    """Return what is kept of a run, by the names of the files: results, and the validations of its training."""
    files = (run.folder / name for name in (RESULTS, MEASURED))
    texts = {path.name: path.read_text(encoding="utf-8") for path in files if path.exists()}
    lines = [json.dumps(line) + "\n" for line in run.history or () if "validation" in line]
    return texts | ({HISTORY: "".join(lines)} if lines else {})


def with_inserted(found: Found, registry: Registry) -> Found:
    """Add, behind each network of Table 2 alone, the same with the touched points inserted into its result.

    Networks of which neither this nor the weights were kept are left out.
    """
    more: Found = {}
    for name, runs in found.items():
        more[name] = runs
        touched = found.get(f"{name}-touch-edge-conv")
        if touched is not None and any((runs[0].folder / file).exists() for file in (MEASURED, WEIGHTS)):
            more[f"{name}{INSERTED}"] = [inserted(runs[0], touched[0], registry)]
    return more


def table2(found: Found) -> Table:
    """A row for each network and kind of touch, then the baselines; ± over objects."""
    found = with_inserted(found, load_plugins())
    made, rows = compared(found, "table2")
    alone = {name: ALONE.get(name, name.removesuffix(INSERTED).partition("-touch")[0]) for name in found}
    differences = {}
    for first in dict.fromkeys(alone.values()):
        differences |= against(found, "table2", first, [name for name in found if alone[name] == first])
    columns = ["network", "touch", "weights", *made.metrics, "cd against the network alone", "cd without touch"]
    columns += ["with another object's", EFFICIENCY, "steps", "last quarter", "min"]
    lines = []
    for name, runs in found.items():
        training, touch = runs[0].results.training, runs[0].results.touch
        of_touch = (None, None) if touch is None else (touch.plain, touch.exchanged)
        lines.append(
            [
                name.removesuffix(INSERTED).partition("-touch")[0].removesuffix("-edge-conv"),
                "inserted afterwards"
                if name.endswith(INSERTED)
                else TOUCH[runs[0].results.recipe["model"]["fusion"]["use"]],
                f"{rows[name].parameters / 1e3:,.0f} K",
                *(cell(rows[name], metric) for metric in made.metrics),
                differences.get(name, ""),
                *("" if each is None else f"{1e3 * fmean(each):.3f}" for each in of_touch),
                efficiency_cell(rows[name].efficiencies or ()),
                "" if training.steps is None else f"{training.steps:,}",
                last_quarter(runs[0]),
                "" if training.seconds is None else f"{training.seconds / 60:.0f}",
            ]
        )
    baselines = {name: row for name, row in rows.items() if name not in found}
    lines += [[name, *[""] * 2, *(cell(row, m) for m in made.metrics), *[""] * 7] for name, row in baselines.items()]
    return columns, lines


def table3(found: Found) -> Table:
    """A row for each rate."""
    _, rows = compared(found, "table3")
    lines = []
    rates = sorted({runs[0].results.data.rate for runs in found.values()})
    for rate in rates:
        midpoint = f"midpoint {rate}×" if len(rates) > 1 else "midpoint"
        names = (f"pu-transformer-rate.{rate}", f"tapsr-rate.{rate}", midpoint)
        lines.append([str(rate), *(cell(rows[name], "cd") if name in rows else "–" for name in names)])
    return ["rate", "PU-Transformer", "TAPSR, 4 touches", "midpoint"], lines


def table4(found: Found) -> Table:
    """A row for each network, a column for each number of touches; ± over seeds."""
    _, rows = compared(found, "table4")
    used = {row: name for row in ROWS4 for name in (f"{row}-touches.0", f"{row}-touches.{USED}") if name in rows}
    differences = against(found, "table4", CONTROL, list(used.values()))
    lines = []
    for row, name in used.items():
        cells = [f"{row}-touches.{count}" for count in COUNTS]
        cells = [cell(rows[one], "cd", over_seeds=True) if one in rows else "" for one in cells]
        shares = [efficiency_cell(one) for one in (rows[name].efficiencies or (), rows[name].exchanged)]
        lines.append([ROWS4[row], *cells, *shares, differences.get(name, "")])
    columns = ["", "no touch", "1 touch", *(f"{count} touches" for count in COUNTS[2:])]
    return [*columns, f"{EFFICIENCY} at {USED}", EXCHANGED, f"at {USED} against the control"], lines


def table5(found: Found) -> Table:
    """Seconds of a training epoch and milliseconds of a cloud, a column for each number of touches."""
    _, rows = compared(found, "table5")
    each = [rows[name] for name in found]
    epochs = [f"{row.epoch:.1f} ({row.published['s/epoch']:g})" for row in each if row.epoch is not None]
    clouds = [f"{1e3 * row.seconds:.0f} ({1e3 * row.published['s/cloud']:g})" for row in each]
    return ["touches", *(str(row.runs[0].data.touches) for row in each)], [["s/epoch", *epochs], ["ms/cloud", *clouds]]


def against(found: Found, study: str, first: str, names: Sequence[str]) -> dict[str, str]:
    """Differences of rows from the first in cd, in per cent of its mean, with their 95 % intervals and p by Holm."""
    others = [name for name in names if name != first and name in found]
    if first not in found or not others:
        return {}
    made, rows = compared({name: found[name] for name in (first, *others)}, study)
    unit = rows[first].mean("cd") / 100
    cells = {}
    for name, difference in zip(others, made.differences["cd"][1:], strict=False):
        if difference is not None and difference.interval is not None and difference.p_value is not None:
            low, high = (end / unit for end in difference.interval)
            p_value = f"p = {difference.p_value:.1g}" if difference.p_value >= 1e-4 else "p < 0.0001"
            cells[name] = f"{difference.mean / unit:+.1f} % [{low:+.1f}, {high:+.1f}], {p_value}"
    return cells


TABLES: dict[str, tuple[str, Callable[[Found], Table]]] = {
    "table-2": ("table2", table2),
    "table-3": ("table3", table3),
    "table-4": ("table4", table4),
    "table-5": ("table5", table5),
}
"""Each table by the name of its file: the study, and what makes the table of its runs."""


@click.command()
@click.argument("runs", type=click.Path(path_type=Path, exists=True, file_okay=False))
@click.option("--save", "saving", is_flag=True, help="Write benchmarks/results, docs/numbers/table-2.json and so on.")
def main(runs: Path, saving: bool) -> None:
    """Print the tables of the runs in RUNS."""
    console, made = Console(stderr=True), False
    try:
        for name, (study, make) in TABLES.items():
            found = finished(runs, study)
            columns, rows = make(found) if found else ((), [])
            if rows and saving:
                for run in (run for of_row in found.values() for run in of_row):
                    keep(run.folder, content(run))
                columns, rows = make(finished(KEPT, study))
            if not rows:
                console.print(f"{name}: left out, as its runs in {runs} are not finished", soft_wrap=True)
                continue
            made = True
            show(columns, rows, title=name)
            if saving:
                save(name, f"pcsr run {study}; python benchmarks/paper_tables.py runs --save", columns, rows)
        if not made:
            raise UserError(f"{runs} holds no finished run of Tables 2 to 5: `pcsr run table2 --runs {runs}`")
    except PcsrError as error:
        raise click.ClickException(str(error)) from error


if __name__ == "__main__":
    main()
