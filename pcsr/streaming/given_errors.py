"""Expected errors of the points of the input, which are computed tile by tile and written in the order of the file."""

import numpy as np
from jaxtyping import Float

from pcsr.clouds.formats.chunks import CHUNK
from pcsr.streaming.sorting import Plan, Tile
from pcsr.streaming.work_folder import WorkFolder

ERRORS = "errors"
"""Name of the file with the error of each point of the input, NaN for points that are not used."""
BYTES = 16
"""Bytes that a point takes on the disk for its error."""


def save_errors(work: WorkFolder, tile: Tile, errors: Float[np.ndarray, " n"]) -> None:
    """Save the errors of the points of a tile."""
    work.save(_name(tile), errors)


def load_errors(work: WorkFolder, plan: Plan) -> np.ndarray:
    """Return the errors of the points of the input in their order, as an array that is mapped from a file."""
    errors = np.memmap(work.raw_path(ERRORS), np.float64, "w+", shape=(plan.count,))
    for start in range(0, plan.count, CHUNK):
        errors[start : start + CHUNK] = np.nan
    for tile in plan.tiles:
        errors[work.load(tile.name)["row"]] = work.load(_name(tile))
    return errors


def _name(tile: Tile) -> str:
    return f"{ERRORS}-{tile.number:06d}"
