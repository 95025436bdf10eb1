"""`pcsr run`: train and evaluate a recipe."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pcsr.cli.options import FILE, plugin_option, set_option
from pcsr.cli.running import prepared, run_each, run_options
from pcsr.errors import UserError

if TYPE_CHECKING:
    from pcsr.experiments.run_options import RunOptions


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
def run(recipe: Path, overrides: tuple[str, ...], row: int | None, registry: Any, options: "RunOptions") -> None:
    """Train and evaluate a recipe, or compare several.

    Writes the weights, the results and a report to a run folder. Finished work is not repeated: training goes on from
    its last checkpoint, and is skipped if the recipe names weights or finished weights of exactly this recipe exist.
    The code of plugins is part of a recipe: after a change of it, the network is trained again, in another run folder.

    A recipe with a matrix, or one that names other recipes, is run row by row, and ends in a table of all rows.
    """
    from pcsr.cli.comparing import check_failed, show
    from pcsr.recipe import load

    recipes = load(recipe, registry, overrides)
    if row is not None:
        if row > len(recipes):
            raise UserError(f"--row {row}: {recipe} has {len(recipes)} runs: give a number from 1 to {len(recipes)}")
        recipes = [recipes[row - 1]]
    recipes = prepared(recipes, registry, options)
    finished, failed = run_each(recipes, registry, options, alone=len(recipes) == 1)
    done = [one for one in finished if one is not None]
    if done and len(recipes) > 1:
        show(done, failed, recipe.stem, options.runs)
    check_failed(failed, len(recipes))
