"""Recorded touches: folders with a manifest `touches.json` and data files. docs/recorded.md describes the format."""

from pcsr.recorded.reading import MANIFEST, Recording, read
from pcsr.recorded.writing import write

__all__ = ["MANIFEST", "Recording", "read", "write"]
