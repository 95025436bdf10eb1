"""Drawing a part's parameters so that no two splits ever share one."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

T = TypeVar("T")

Number = int | float
"""A length in mm or an angle in degrees; whole ones are written without a point."""

CELLS = 50
"""Each parameter's range is cut into so many cells. One in ten belongs to validation, one in ten to test."""
SPLITS = {"train": (0, 1, 2, 4, 5, 6, 8, 9), "validation": (3,), "test": (7,)}


class Draw:
    """One part's random numbers.

    Continuous parameters come from the split's own cells: a held-out part resembles training parts, as a new
    part of a known family does, but never has a length, radius or angle that training drew. Structural
    choices (how many holes, ribs or none) are shared.
    """

    def __init__(self, split: str, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._cells = [cell for cell in range(CELLS) if cell % 10 in SPLITS[split]]

    def __call__(self, low: Number, high: Number) -> float:
        """A number between the two."""
        cell = self._cells[int(self._rng.integers(len(self._cells)))]
        return low + (high - low) * (cell + float(self._rng.random())) / CELLS

    def whole(self, low: int, high: int) -> int:
        """A whole number, both ends included."""
        return int(self._rng.integers(low, high + 1))

    def one_of(self, choices: Sequence[T]) -> T:
        """One of several."""
        return choices[int(self._rng.integers(len(choices)))]

    def maybe(self, chance: Number = 0.5) -> bool:
        """True with a probability."""
        return bool(self._rng.random() < chance)
