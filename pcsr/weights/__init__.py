"""The weights that come with pcsr, a file for each recipe; each file's header holds its recipe."""

from pathlib import Path

DEFAULT = "tapsr"
"""What is used where no model is named."""
HERE = Path(__file__).parent


def shipped(recipe: str) -> Path:
    """Where the shipped weights of a recipe of this name are, if there are any."""
    return HERE / f"{recipe}.safetensors"


def names() -> list[str]:
    """Of all shipped weights."""
    return sorted(path.stem for path in HERE.glob("*.safetensors"))
