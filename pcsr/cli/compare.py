"""`pcsr compare`: train and evaluate recipes or parts on the same data, seeds and budget, in one table."""

import re
from pathlib import Path
from typing import Any

import click

from pcsr.cli.options import FILE, complete_part, plugin_option, set_option
from pcsr.cli.running import run_all, run_options
from pcsr.errors import UserError

NAME = r"[a-z0-9][a-z0-9.-]{0,99}"
"""Pattern of the page's name, which must be valid as a file name on every system."""
KINDS = ("encoder", "fusion", "backbone", "upsampler", "objective")
"""Kinds of parts that have an option of their own."""


def _part_options(command: Any) -> Any:
    for kind in reversed(KINDS):
        command = click.option(
            f"--{kind}",
            kind,
            multiple=True,
            metavar="NAME",
            shell_complete=complete_part(kind),
            help=f"Compare this {kind}. May be repeated.",
        )(command)
    return command


@click.command()
@click.argument("recipes", nargs=-1, required=True, type=FILE)
@_part_options
@click.option(
    "--seeds",
    type=click.IntRange(1, 1000),
    default=1,
    show_default=True,
    metavar="N",
    help="Train each N times, with seeds 0 to N-1, on the same data.",
)
@click.option("--name", default="compare", show_default=True, metavar="NAME", help="Name of the page with the tables.")
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
    """Train and evaluate recipes or parts under equal conditions.

    Each of RECIPES is run with every combination of the parts that the options name. All runs use the same data;
    --seeds varies the training only. Wins are counted against the first row of the table.

    \b
    pcsr compare smoke --fusion concat --fusion iterative --seeds 3
    pcsr compare tapsr pu-transformer --set train.epochs=5
    """  # noqa: D301 (click's mark is the letter itself)
    from pcsr.recipe import load

    if not re.fullmatch(NAME, name):
        raise UserError(
            f"--name {name!r}: it must have 1 to 100 characters of a-z, 0-9, . and -, and begin with a letter or digit"
        )
    axes: dict[str, list[Any]] = {}
    for kind, named in parts.items():
        if named:
            axes[f"{'train' if kind == 'objective' else 'model'}.{kind}"] = list(named)
    if seeds > 1:
        axes["seed"] = list(range(seeds))
    every = [one for file in recipes for one in load(file, registry, overrides, axes)]
    run_all(every, registry, where, name)
