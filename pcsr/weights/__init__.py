"""Weights files: shipped weights, and how weights are found, read, and loaded into a network."""

from pathlib import Path

WEIGHTS = "weights.safetensors"
"""Name of the weights file in a run folder and on the Hugging Face hub."""
DEFAULT = "frames"
"""Name of the shipped weights that are used by default."""
HERE = Path(__file__).parent
"""Folder of the shipped weights."""


def shipped(recipe: str) -> Path:
    """Return the path of the shipped weights of a recipe. The file may not exist."""
    return HERE / f"{recipe}.safetensors"


def names() -> list[str]:
    """Return the names of all shipped weights."""
    return sorted(path.stem for path in HERE.glob("*.safetensors"))
