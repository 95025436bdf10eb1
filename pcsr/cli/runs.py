"""`pcsr runs`: list, show and remove run folders."""

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE
from pcsr.cli.runs_remove import remove
from pcsr.cli.runs_show import show
from pcsr.cli.runs_where import check_key, chosen, where_option
from pcsr.counted import counted

if TYPE_CHECKING:
    from pcsr.run_folders import RunFolder


@click.group(invoke_without_command=True)
@click.option("--runs", type=FILE, default=Path("runs"), show_default=True, help="Folder of the run folders.")
@where_option
@click.option(
    "--sort",
    "key",
    default="age",
    show_default=True,
    metavar="KEY",
    help="Sort by this value, upwards: age, name, size, a metric, or a key as for --where.",
)
@click.option("--reverse", is_flag=True, help="Sort downwards.")
@click.option("--json", "plain", is_flag=True, help="Print as JSON.")
@click.pass_context
def runs(context: click.Context, runs: Path, conditions: tuple[str, ...], key: str, reverse: bool, plain: bool) -> None:
    """List, show and remove run folders.

    Without a command, lists the runs: parts, budget, metrics of the network, age and size. Numbers can be compared
    where the data are the same; pcsr compare checks that.

    \b
    pcsr runs --where fusion=iterative --sort cd
    pcsr runs show smoke-1a2b3c4d
    pcsr runs rm smoke-1a2b3c4d
    pcsr runs rm 'smoke-*' --where state=unfinished
    """  # noqa: D301 (click's mark is the letter itself)
    context.obj = runs
    if context.invoked_subcommand is not None:
        return
    from pcsr.run_folders import run_folders

    every = run_folders(runs)
    listed = chosen(every, conditions)
    listed = _sorted(listed, key, reverse)
    if plain:
        click.echo(json.dumps([_plain(run) for run in listed], indent=1))
    elif listed:
        console = streams.console()
        console.print(_table(listed, runs))
        for run in listed:
            if run.remark:
                text = f"{run.folder}: {run.state}, {run.remark}"
                console.print(text, markup=False, highlight=False, soft_wrap=True)
    else:
        click.echo(f"no run in {runs}" + (f" matches; it has {len(every)}" if every else ""))


def _sorted(listed: "Sequence[RunFolder]", key: str, reverse: bool) -> "list[RunFolder]":
    """Return runs in the order of a value; those without it come last.

    Raises:
        UserError: no run has the key.
    """
    check_key("--sort", key, listed)
    having = [run for run in listed if run.value(key) is not None]
    numbers = all(isinstance(run.value(key), int | float) for run in having)
    having.sort(key=lambda run: run.value(key) if numbers else str(run.value(key)), reverse=reverse)
    return [*having, *(run for run in listed if run.value(key) is None)]


def _table(listed: "Sequence[RunFolder]", folder: Path) -> Any:
    from pcsr.limits import gigabytes
    from pcsr.report.tables.scores import decimals_of, scaled
    from pcsr.report.tables.text_table import TextTable

    metrics = {metric: note for run in listed if run.results for metric, note in run.results.metrics.items()}
    least = {metric: min(run.means[metric] for run in listed if metric in run.means) for metric in metrics}
    known = [run for run in listed if run.parts]
    common = {part for run in known[:1] for part in run.parts.items() if all(part in r.parts.items() for r in known)}
    kinds = list(dict.fromkeys(key for run in listed for key in run.parts if (key, run.parts[key]) not in common))
    heads = ["", "seed", *(key.partition(".")[2] for key in kinds), "budget"]
    heads += [*(scaled(metric, note.scale) for metric, note in metrics.items()), "age", "size"]
    cells = []
    for run in listed:
        means = [f"{run.means[m]:.{decimals_of(least[m])}f}" if m in run.means else "" for m in metrics]
        name = run.folder.name + (f"\n{run.state}" if run.remark else "")
        seed = run.value("seed")
        parts = [run.parts.get(key, "") for key in kinds]
        cells.append([name, "" if seed is None else str(seed), *parts, budget(run), *means, age(run)])
        cells[-1].append(gigabytes(run.size))
    note = f"{counted(len(listed), 'run')}, {gigabytes(sum(run.size for run in listed))} in {folder}. "
    if common:
        note += (
            f"All have {', '.join(f'{key} {name}' for key, name in listed[0].parts.items() if (key, name) in common)}. "
        )
    note += "Metrics: mean of the network over the test objects."
    return TextTable(str(folder), heads, cells, note)


def budget(run: "RunFolder") -> str:
    """Length of a run's training, such as ``10 epochs, 600 steps``."""
    if run.value("weights") is not None:
        return f"weights {run.value('weights')}"
    if run.results is not None:
        return ", ".join(run.results.budget)
    epochs = run.value("train.epochs")
    return "" if epochs is None else counted(epochs, "epoch")


def age(run: "RunFolder") -> str:
    """Time since the last change of a run, such as ``5 min``."""
    seconds = max(0.0, time.time() - run.changed)
    for unit, length in (("d", 86_400), ("h", 3600), ("min", 60)):
        if seconds >= length:
            return f"{seconds / length:.0f} {unit}"
    return f"{seconds:.0f} s"


def _plain(run: "RunFolder") -> dict[str, Any]:
    return {
        "folder": str(run.folder),
        "state": run.state,
        "remark": run.remark,
        "name": run.value("name") if run.results is None else run.results.name,
        "seed": run.value("seed"),
        "parts": run.parts,
        "epochs": run.value("train.epochs"),
        "steps": None if run.results is None else run.results.training.steps,
        "metrics": run.means,
        "data": None if run.results is None else run.results.data.fingerprint,
        "version": run.value("version"),
        "changed": run.changed,
        "bytes": run.size,
    }


runs.add_command(show)
runs.add_command(remove)
