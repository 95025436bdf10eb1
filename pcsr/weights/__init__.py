"""The weights that come with pcsr, a file for each recipe; each file's header holds its recipe and its metrics."""

from pathlib import Path


def shipped(name: str) -> Path:
    """Where the weights of recipe `name` are, or would be."""
    return Path(__file__).with_name(f"{name}.safetensors")
