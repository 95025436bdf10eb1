"""Clouds as rows of one structured array, in which parts of a cloud are stored on disk."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Int

from pcsr.clouds.cloud import Cloud


def packed(cloud: Cloud, rows: Int[np.ndarray, " n"]) -> np.ndarray:
    """Return a structured array (n,) with the points and columns of a cloud.

    Args:
        cloud: the cloud.
        rows: row of each point in the file.
    """
    columns = list(cloud.columns.values())
    fields: list[Any] = [("row", "<i8"), ("points", "<f8", (3,))]
    fields += [(f"column {i}", column.dtype, column.shape[1:]) for i, column in enumerate(columns)]
    table = np.zeros(len(cloud), fields)
    table["row"], table["points"] = rows, cloud.points
    for i, column in enumerate(columns):
        table[f"column {i}"] = column
    return table


def unpacked(table: np.ndarray, names: Sequence[str], about: dict[str, Any]) -> Cloud:
    """Return the cloud of a structured array.

    Args:
        table: array that `packed` returned.
        names: names of the columns.
        about: `about` of the cloud.
    """
    columns = {name: np.ascontiguousarray(table[f"column {i}"]) for i, name in enumerate(names)}
    return Cloud(np.ascontiguousarray(table["points"]), columns, about)
