"""Progress of one tile among that of all."""

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class TileProgress:
    """Function that reports how far a tile is as a part of all tiles."""

    before: int
    """Number of points of the tiles before it."""
    count: int
    """Number of its points."""
    total: int
    """Number of points of all tiles."""
    advance: Callable[[int, int], None]
    """Called with the number of points that are done, and of all."""

    def __call__(self, done: int, total: int) -> None:
        """Report that `done` of `total` steps of the tile are done."""
        self.advance(self.before + done * self.count // total, self.total)
