"""The weights that come with pcsr, a file for each recipe; each file's header holds its recipe."""

import os
from pathlib import Path

from pcsr.errors import UserError, did_you_mean
from pcsr.validation_messages import shown, shown_path

DEFAULT = "frames"
"""What is used where no model is named."""
HERE = Path(__file__).parent


def shipped(recipe: str) -> Path:
    """Where the shipped weights of a recipe of this name are, if there are any."""
    return HERE / f"{recipe}.safetensors"


def names() -> list[str]:
    """Of all shipped weights."""
    return sorted(path.stem for path in HERE.glob("*.safetensors"))


def found(use: str, folder: Path = Path()) -> Path:
    """The weights file that a recipe means.

    Args:
        use: the name of shipped weights, or a file.
        folder: that a file is relative to.

    Raises:
        UserError: there is neither.
    """
    if use in names():
        return shipped(use)
    # These two take a user that isn't there, and a name that no file can have, for a file that isn't there.
    path = folder / Path(os.path.expanduser(use))
    if not os.path.exists(path):
        hint = did_you_mean(use, names())
        raise UserError(
            f"there are no weights {shown(use)}, neither shipped ones nor a file {shown_path(path)}: {hint}"
        )
    return path
