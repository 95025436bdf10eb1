"""`pcsr run`: train and evaluate a recipe."""

from pathlib import Path
from typing import Any

import click

from pcsr.cli.options import FILE, plugin_option, set_option
from pcsr.cli.running import run_all, run_options
from pcsr.errors import UserError


@click.command()
@click.argument("recipe", type=FILE)
@set_option
@click.option(
    "--row",
    type=click.IntRange(1),
    default=None,
    metavar="N",
    help="Run only the N-th recipe of a study, counted from 1, as a job of a job array does.  [default: all]",
)
@plugin_option
@run_options
def run(recipe: Path, overrides: tuple[str, ...], row: int | None, registry: Any, where: dict[str, Any]) -> None:
    """Train and evaluate a recipe, or compare several.

    Writes the weights, the results and a report to a run folder. Finished work is not repeated: training goes on from
    its last checkpoint, and is skipped if the recipe names weights or finished weights of exactly this recipe exist.
    The code of plugins is part of a recipe: after a change of it, the network is trained again, in another run folder.

    A recipe with a matrix, or one that names other recipes, is run row by row, and ends in a table of all rows.
    """
    from pcsr.recipe import load

    recipes = load(recipe, registry, overrides)
    if row is not None:
        if row > len(recipes):
            raise UserError(f"--row {row}: {recipe} has {len(recipes)} runs: give a number from 1 to {len(recipes)}")
        recipes = [recipes[row - 1]]
    run_all(recipes, registry, where, recipe.stem)
