"""Reading of one tactile image: what a calibrated sensor measured."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float


@dataclass(frozen=True, eq=False)
class Reading:
    """Indentation of a gel, and the points in contact with it. Lengths are in millimetres.

    The sensor's frame has its origin at the centre of the untouched gel's face, x to the right of the image, y up, and
    z out of the object into the gel.

    Examples:
        >>> from pcsr.sensors import Reading
        >>> points = np.array([[0.0, 0.0, 0.5]])
        >>> mask = np.ones((1, 1), bool)
        >>> reading = Reading(np.full((1, 1), 0.5), mask, points, np.array([0.02]), area=0.01, view=None)
        >>> reading.points[:, 2] / reading.errors
        array([25.])
    """

    indentation: Float[np.ndarray, "rows columns"]
    """Indentation of the gel at each pixel, relative to the untouched gel."""
    contact: Bool[np.ndarray, "rows columns"]
    """Pixels in contact: indented by at least 0.4 of the greatest indentation, and connected with it."""
    points: Float[np.ndarray, "m 3"]
    """Points in contact, in the sensor's frame."""
    errors: Float[np.ndarray, " m"]
    """Expected error of each point along z, one standard deviation."""
    area: float
    """Area of the contact in square millimetres."""
    view: tuple[float, float] | None
    """Sides of the visible part of the gel along x and y; None for a domed gel."""

    @property
    def at_edge(self) -> bool:
        """Whether the contact reaches the edge of the image, so that a part of it may be out of view.

        The membrane is held at the edge of the gel and cannot sink in there, so that heights beside such a contact may
        be taken for a part of it.
        """
        mask = self.contact
        return bool(mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any())
