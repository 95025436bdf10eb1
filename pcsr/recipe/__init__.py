"""Recipes: plain YAML that says which parts make a network, on which data, and how it is trained."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from pcsr.plugins.registry import Registry
from pcsr.recipe.check import check, check_card
from pcsr.recipe.compose import compose, override_key
from pcsr.recipe.part_keys import DATA, MODEL, PARTS
from pcsr.recipe.pretrained import check_with_weights
from pcsr.recipe.schema import Data, PartSpec, Patches, Recipe, View
from pcsr.recipe.source import MOST_TOLD, Keys, Mistake, Place, RecipeError, Source
from pcsr.recipes import found

__all__ = [
    "DATA",
    "MODEL",
    "PARTS",
    "Data",
    "Mistake",
    "PartSpec",
    "Patches",
    "Place",
    "Recipe",
    "RecipeError",
    "View",
    "check_card",
    "for_data",
    "from_resolved",
    "load",
]

MOST_STUDIED = 5
"""Touches of each object in the paper's data set (Fig. 4, Table 1)."""


def load(
    path: Path, registry: Registry, overrides: Sequence[str] = (), axes: Mapping[str, Sequence[Any]] | None = None
) -> list[Recipe]:
    """Read and check a recipe; one recipe for each row of its matrix, and for each recipe that it names.

    Args:
        path: the recipe's file, or the name of one that comes with pcsr.
        registry: the parts that it may name.
        overrides: each `dotted.key=value`, the value in YAML.
        axes: dotted keys with values to vary, as in a matrix.

    Raises:
        RecipeError: every mistake in it, with file, line and column.
        UserError: a file that can't be read.
    """
    recipes = []
    mistakes: set[Mistake] = set()
    for source in compose(found(path), overrides, axes or {}):
        try:
            recipes.append(check_with_weights(source, registry))
        except RecipeError as error:
            mistakes.update(error.mistakes)
            if len(mistakes) > MOST_TOLD:  # a mistake of the file is found in each run of its matrix
                break
    if mistakes:
        raise RecipeError(mistakes)
    return recipes


def for_data(
    shapes: str, options: dict[str, Any], registry: Registry, overrides: Sequence[str] = (), part: str | None = None
) -> Recipe:
    """A recipe for its data alone.

    Args:
        shapes: the part that gives the objects.
        options: of that part.
        registry: the parts that it may name.
        overrides: each `key=value`. A key of a recipe's section `data` is meant; any other is an option of the
            shapes: `points=256`, `touch.object_size=30`, `count=40`.
        part: "touch", say: the overrides are options of that part alone.

    Raises:
        RecipeError: every mistake in it.
    """
    data = {"shapes": {"use": shapes, **options}, "touches": MOST_STUDIED}
    source = Source({"name": "data", "data": data}, {(): Place(f"shapes {shapes}")})
    for override in overrides:
        key = override.partition("=")[0].partition(".")[0]
        section = part or ("" if key in Data.model_fields else "shapes")
        override_key(source, ".".join(filter(None, ("data", section, override))), override)
    return check(source, registry)


def from_resolved(
    data: dict[str, Any],
    registry: Registry,
    origin: str = "recipe in the weights",
    parts: Collection[Keys] = PARTS.keys(),
) -> Recipe:
    """A recipe from what `Recipe.resolved` gave.

    Args:
        data: what it gave.
        registry: gives the parts.
        origin: names it in messages.
        parts: the places whose parts are checked and must be here; all by default, `DATA` to build data.

    Raises:
        RecipeError: it names parts or options that this installation doesn't have.
    """
    return check(Source(data, {(): Place(origin)}), registry, parts)
