"""Recipes: plain YAML that says which parts make a network, on which data, and how it is trained."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pcsr.recipe.check import check
from pcsr.recipe.compose import compose
from pcsr.recipe.schema import Data, PartSpec, Recipe
from pcsr.recipe.source import Mistake, Place, RecipeError, Source
from pcsr.registry import Registry

__all__ = ["Data", "Mistake", "PartSpec", "Place", "Recipe", "RecipeError", "from_resolved", "load"]


def load(path: Path, registry: Registry, overrides: Sequence[str] = ()) -> list[Recipe]:
    """Read and check a recipe; one recipe for each row of its matrix.

    Args:
        path: the recipe's file.
        registry: the parts that it may name.
        overrides: each `dotted.key=value`, the value in YAML.

    Raises:
        RecipeError: every mistake in it, with file, line and column.
        UserError: a file that can't be read.
    """
    recipes, mistakes = [], []
    for source in compose(path, overrides):
        try:
            recipes.append(check(source, registry))
        except RecipeError as error:
            mistakes += error.mistakes
    if mistakes:
        raise RecipeError(mistakes)
    return recipes


def from_resolved(data: dict[str, Any], registry: Registry, origin: str = "recipe in the weights") -> Recipe:
    """A recipe from what `Recipe.resolved` gave.

    Raises:
        RecipeError: it names parts or options that this installation doesn't have.
    """
    return check(Source(data, {(): Place(origin)}), registry)
