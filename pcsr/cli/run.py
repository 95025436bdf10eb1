"""`pcsr run`: a recipe to weights, a table and a report."""

from pathlib import Path
from typing import Any

import click

from pcsr.cli.options import FILE, plugin_option, set_option


@click.command()
@click.argument("recipe", type=FILE)
@set_option
@plugin_option
@click.option(
    "--runs",
    type=FILE,
    default=Path("runs"),
    show_default=True,
    help="Where run folders go.",
)
@click.option(
    "--device",
    type=click.Choice(["auto", "cpu", "cuda"]),
    default="auto",
    show_default=True,
    help="Where to compute; auto is cuda where there is one.",
)
@click.option(
    "--devices",
    type=click.IntRange(1),
    default=1,
    show_default=True,
    help="Processes on this machine, one for each GPU.",
)
@click.option(
    "--nodes",
    type=click.IntRange(1),
    default=1,
    show_default=True,
    help="Machines, as torchrun or SLURM started them.",
)
@click.option(
    "--jobs",
    type=click.IntRange(1),
    default=None,
    help="Processes for data and metrics.  [default: all cores]",
)
@click.option(
    "--data",
    type=FILE,
    default=None,
    help="Use the data in this folder, which `pcsr data make` built, instead of the recipe's own.",
)
def run(recipe: Path, overrides: tuple[str, ...], registry: Any, runs: Path, data: Path | None, **where: Any) -> None:
    """Train and evaluate a recipe, or compare several.

    What is done already is not done again: training goes on from its last checkpoint, and is skipped where finished
    weights of exactly this recipe exist. A recipe with a matrix runs row by row.
    """
    import torch
    from rich.console import Console

    from pcsr import report
    from pcsr.data.plan import on_data
    from pcsr.data.shards import read_manifest
    from pcsr.recipe import load
    from pcsr.run import Place, run, run_folder

    console = Console()
    place = Place(runs=runs, data=data, **where)
    recipes = load(recipe, registry, overrides)
    if data is not None:
        manifest = read_manifest(data)
        recipes = [on_data(one, manifest, data, registry) for one in recipes]
        console.print(
            f"data: all but the number of touches is as {data} says, whatever the recipe's section data does",
            markup=False,
            soft_wrap=True,
        )
    for one in recipes:
        results = run(one, registry, place, console)
        if results:  # one process of several has them
            console.print(report.table(results))
            console.print(f"report: {run_folder(one, place) / 'report.html'}", soft_wrap=True)
    if torch.distributed.is_available() and torch.distributed.is_initialized():
        # Left to the end of the process, its threads may still run then, and it would abort.
        torch.distributed.destroy_process_group()
