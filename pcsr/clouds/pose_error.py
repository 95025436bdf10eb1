"""Error of the poses that a robot reports."""

from dataclasses import dataclass

import numpy as np

from pcsr.errors import UserError

MOST_POSITION, MOST_ROTATION = 100.0, 45.0
"""Largest standard deviations, in millimetres and degrees, that a pose may have."""


@dataclass(frozen=True)
class PoseError:
    """Standard deviation of the error of a pose that a robot reports; 0 and 0 for exact poses.

    Raises:
        UserError: a number is no number, negative, not finite or too large.

    Examples:
        >>> pcsr.PoseError(position=0.3, rotation=0.2)
        PoseError(position=0.3, rotation=0.2)
    """

    position: float = 1.0
    """Along each axis, in millimetres."""
    rotation: float = 2.0
    """About each axis, in degrees."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, value, most, unit in (
            ("position", self.position, MOST_POSITION, "mm"),
            ("rotation", self.rotation, MOST_ROTATION, "degrees"),
        ):
            if not isinstance(value, int | float | np.number) or isinstance(value, bool):
                raise UserError(f"pose error: {name} is {value!r}: it must be a number of {unit}, 0 to {most:g}")
            if not 0 <= value <= most:
                raise UserError(f"pose error: {name} is {value:g} {unit}: it must be 0 to {most:g}")

    @classmethod
    def at_most(cls, position: float, rotation: float) -> "PoseError":
        """Create an error, of the largest size that can be stated where these numbers are larger.

        Examples:
            >>> pcsr.PoseError.at_most(position=500.0, rotation=0.2)
            PoseError(position=100.0, rotation=0.2)
        """
        return cls(min(position, MOST_POSITION), min(rotation, MOST_ROTATION))

    @property
    def exact(self) -> bool:
        """Whether the poses have no error."""
        return self.position == 0 and self.rotation == 0
