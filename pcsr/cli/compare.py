"""`pcsr compare`: parts or recipes against each other, on the same data, seeds and budget, to one table."""

import re
from pathlib import Path
from typing import Any

import click

from pcsr.cli.options import FILE, plugin_option, set_option
from pcsr.cli.running import run_all, run_options
from pcsr.errors import UserError

NAME = r"[a-z0-9][a-z0-9.-]{0,99}"
"""What is a file's name everywhere, and beside the run folders."""
KINDS = ("encoder", "fusion", "backbone", "upsampler", "objective")


def _part_options(command: Any) -> Any:
    for kind in reversed(KINDS):
        command = click.option(
            f"--{kind}", kind, multiple=True, metavar="NAME", help=f"Compare this {kind}. May be repeated."
        )(command)
    return command


@click.command()
@click.argument("recipes", nargs=-1, required=True, type=FILE)
@_part_options
@click.option(
    "--seeds", type=click.IntRange(1, 1000), default=1, show_default=True, help="Trainings of each, on one data."
)
@click.option("--name", default="compare", show_default=True, help="Of the page with the tables.")
@set_option
@plugin_option
@run_options
def compare(
    recipes: tuple[Path, ...],
    seeds: int,
    name: str,
    overrides: tuple[str, ...],
    registry: Any,
    where: dict[str, Any],
    **parts: tuple[str, ...],
) -> None:
    """Train and measure recipes, or one with several parts, alike.

    Each recipe is run with each combination of the parts that are named. All see the same data; with --seeds too, which
    varies the training alone. The first row of the table is what wins are counted against.

    \b
    pcsr compare recipes/smoke.yaml --fusion concat --fusion iterative --seeds 3
    pcsr compare recipes/tapsr.yaml recipes/pu-transformer.yaml --set train.epochs=5
    """  # noqa: D301 (click's mark is the letter itself)
    from pcsr.recipe import load

    if not re.fullmatch(NAME, name):
        raise UserError(f"--name {name!r}: it must be up to 100 of a-z, 0-9, . and -, the first a letter or a digit")
    axes: dict[str, list[Any]] = {}
    for kind, named in parts.items():
        if named:
            axes[f"{'train' if kind == 'objective' else 'model'}.{kind}"] = list(named)
    if seeds > 1:
        axes["seed"] = list(range(seeds))
    every = [one for file in recipes for one in load(file, registry, overrides, axes)]
    run_all(every, registry, where, name)
