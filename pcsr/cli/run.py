"""`pcsr run`: train and evaluate a recipe."""

from pathlib import Path
from typing import Any

import click

from pcsr.cli.options import FILE, plugin_option, set_option
from pcsr.cli.running import run_all, run_options


@click.command()
@click.argument("recipe", type=FILE)
@set_option
@plugin_option
@run_options
def run(recipe: Path, overrides: tuple[str, ...], registry: Any, where: dict[str, Any]) -> None:
    """Train and evaluate a recipe, or compare several.

    Writes the weights, the results and a report to a run folder. Finished work is not repeated: training goes on from
    its last checkpoint, and is skipped if the recipe names weights or finished weights of exactly this recipe exist.
    The code of plugins is part of a recipe: after a change of it, the network is trained again, in another run folder.

    A recipe with a matrix, or one that names other recipes, is run row by row, and ends in a table of all rows.
    """
    from pcsr.recipe import load

    run_all(load(recipe, registry, overrides), registry, where, recipe.stem)
