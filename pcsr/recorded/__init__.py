"""Touches that people recorded: a folder with a `touches.json` and files beside it. docs/recorded.md has the format."""

from pcsr.recorded.reading import MANIFEST, Recording, read
from pcsr.recorded.writing import write

__all__ = ["MANIFEST", "Recording", "read", "write"]
