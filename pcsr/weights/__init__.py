"""Weights files: those that come with pcsr, how one is found, read, and fitted to a network."""

from pathlib import Path

WEIGHTS = "weights.safetensors"
"""The name of the weights file in a run folder and on the hub."""
DEFAULT = "frames"
"""The shipped weights that are used where no model is named."""
HERE = Path(__file__).parent
"""The folder of the shipped weights."""


def shipped(recipe: str) -> Path:
    """The path of the shipped weights of a recipe; there may be none."""
    return HERE / f"{recipe}.safetensors"


def names() -> list[str]:
    """The names of all shipped weights."""
    return sorted(path.stem for path in HERE.glob("*.safetensors"))
