"""Recipes: YAML files that name the parts of a network, its data and its training."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from pcsr.plugins.registry import Registry
from pcsr.recipe.check import check, check_card
from pcsr.recipe.compose import compose, override_key
from pcsr.recipe.part_keys import DATA, MODEL, PARTS
from pcsr.recipe.pretrained import check_with_weights
from pcsr.recipe.schema import Data, Patches, Recipe, Registration, View
from pcsr.recipe.section import PartSpec
from pcsr.recipe.source import MOST_LISTED, Keys, Location, Mistake, RecipeError, Source
from pcsr.recipes import found

__all__ = [
    "DATA",
    "MODEL",
    "PARTS",
    "Data",
    "Location",
    "Mistake",
    "PartSpec",
    "Patches",
    "Recipe",
    "RecipeError",
    "Registration",
    "View",
    "check_card",
    "for_data",
    "from_resolved",
    "load",
]

PAPER_TOUCHES = 5
"""Number of touches for each object in the paper's data set (Fig. 4, Table 1)."""


def load(
    path: Path, registry: Registry, overrides: Sequence[str] = (), axes: Mapping[str, Sequence[Any]] | None = None
) -> list[Recipe]:
    """Read and check a recipe file.

    Args:
        path: recipe file, or the name of a recipe that comes with pcsr.
        registry: parts that the recipe may name. It gets the file of the network that a graft names, which is imported.
        overrides: changes of the form `dotted.key=value`, with the value in YAML.
        axes: dotted keys with the values to vary, as in a matrix.

    Returns:
        One recipe for each run: for each row of the matrix, and for each recipe that a study names.

    Raises:
        RecipeError: the recipe has mistakes; it holds all of them, each with file, line and column.
        UserError: a file cannot be read.
    """
    recipes = []
    mistakes: set[Mistake] = set()
    for source in compose(found(path), overrides, axes or {}):
        try:
            recipes.append(check_with_weights(source, registry))
        except RecipeError as error:
            mistakes.update(error.mistakes)
            if len(mistakes) > MOST_LISTED:  # further runs of a matrix mostly repeat the same mistakes
                break
    if mistakes:
        raise RecipeError(mistakes)
    return recipes


def for_data(
    shapes: str, options: dict[str, Any], registry: Registry, overrides: Sequence[str] = (), part: str | None = None
) -> Recipe:
    """Return a recipe with defaults, of which only the section `data` is of use.

    Args:
        shapes: name of the shape source.
        options: options of the shape source.
        registry: parts that the recipe may name.
        overrides: changes of the form `key=value`. The key is one of the section `data`, such as `points=256` or
            `touch.object_size=30`, or else an option of the shape source, such as `count=40`.
        part: key of a part in the section `data`, such as "touch", whose options all overrides are.

    Raises:
        RecipeError: the recipe has mistakes; it holds all of them.
    """
    data = {"shapes": {"use": shapes, **options}, "touches": PAPER_TOUCHES}
    source = Source({"name": "data", "data": data}, {(): Location(f"shapes {shapes}")})
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
    """Check a resolved recipe.

    Args:
        data: result of `Recipe.resolved`.
        registry: installed parts.
        origin: name of the recipe's source in messages.
        parts: keys of the parts that are checked and must be installed. All by default; `DATA` to build data.

    Raises:
        RecipeError: the recipe names parts or options that this installation does not have.
    """
    return check(Source(data, {(): Location(origin)}), registry, parts)
