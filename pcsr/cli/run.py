"""`pcsr run`: a recipe to weights, a table and a report."""

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

    What is done already is not done again: training goes on from its last checkpoint, and is skipped where finished
    weights of exactly this recipe exist, or the recipe names weights. The code of plugins belongs to a recipe: after an
    edit it is trained again, in a folder beside the old one. A recipe with a matrix, or one that names others,
    runs row by row, and ends in a table of all of them.
    """
    from pcsr.recipe import load

    run_all(load(recipe, registry, overrides), registry, where, recipe.stem)
