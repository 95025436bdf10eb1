"""The recipes that come with pcsr, and how they are found: by name, such as `tapsr` or `touch/size`."""

import os
from pathlib import Path

from pcsr.errors import UserError, did_you_mean
from pcsr.validation_messages import shown

HERE = Path(__file__).parent


def names() -> list[str]:
    """Names of all recipes that come with pcsr."""
    return sorted(path.relative_to(HERE).with_suffix("").as_posix() for path in HERE.rglob("*.yaml"))


def found(recipe: Path) -> Path:
    """The file that a person means by a path or a name.

    A file that is there is meant itself. `recipes/tapsr.yaml` and `tapsr` both name one that comes with pcsr.

    Raises:
        UserError: there is neither such a file nor such a name.
    """
    if os.path.exists(recipe) and not os.path.isdir(recipe):
        return recipe
    name = recipe.as_posix().removeprefix("recipes/").removesuffix(".yaml")
    if name in names():
        return HERE / f"{name}.yaml"
    if recipe.suffix in (".yaml", ".yml") or os.path.isdir(recipe):
        return recipe  # reading it says what is wrong
    raise UserError(
        f"there is no recipe {shown(str(recipe))}, neither a file nor one that comes with pcsr: "
        f"{did_you_mean(name, names())}"
    )
