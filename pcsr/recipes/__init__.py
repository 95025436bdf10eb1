"""Recipes that come with pcsr. They are found by name, such as `tapsr` or `touch/size`."""

import os
from pathlib import Path

from pcsr.errors import UserError, did_you_mean
from pcsr.validation_messages import shown

HERE = Path(__file__).parent


def names() -> list[str]:
    """Return the names of all recipes that come with pcsr."""
    return sorted(path.relative_to(HERE).with_suffix("").as_posix() for path in HERE.rglob("*.yaml"))


def found(recipe: Path) -> Path:
    """Return the file of a recipe that is given as a path or a name.

    An existing file takes precedence. Otherwise `recipes/tapsr.yaml` and `tapsr` both name a recipe of pcsr. A path of
    a folder, or one with the suffix `.yaml` or `.yml`, is returned even if there is no such file.

    Raises:
        UserError: there is neither a file nor a recipe of this name.
    """
    if os.path.exists(recipe) and not os.path.isdir(recipe):
        return recipe
    name = recipe.as_posix().removeprefix("recipes/").removesuffix(".yaml")
    if name in names():
        return HERE / f"{name}.yaml"
    if recipe.suffix in (".yaml", ".yml") or os.path.isdir(recipe):
        return recipe  # reading it raises the error
    raise UserError(
        f"there is no recipe {shown(str(recipe))}, neither a file nor one that comes with pcsr: "
        f"{did_you_mean(name, names())}"
    )
