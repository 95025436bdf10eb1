"""Points of the true surface in the place of touches: a bound on what touch can tell a network. Our own.

Each touch is a random sample of the whole surface, uniform by area, without noise. A network that uses touches at all
must profit from as many points of the truth, wherever they lie; what it makes of them bounds what it can make of the
touches of a sensor, whose points lie on small regions.
"""

from typing import Annotated

import numpy as np
from jaxtyping import Float
from pydantic import Field

from pcsr import ShapeItem, Touch, TouchSource
from pcsr.geometry.sampling import surface_points


class Surface(TouchSource):
    """Random points of the whole surface."""

    def __init__(
        self,
        *,
        points: Annotated[int, Field(ge=1, le=1 << 20)] = 512,
        unit: Annotated[float, Field(gt=0, le=1e9)] = 1.0,
    ) -> None:
        """Create the source.

        Args:
            points: of each touch.
            unit: of the objects, in millimetres: 1000 where it is the metre.
        """
        self.points, self.unit = points, unit

    def touches(self, item: ShapeItem, cloud: Float[np.ndarray, "n 3"], count: int, seed: int) -> list[Touch]:
        """Draw `count` samples of the surface.

        Raises:
            UserError: the object has no surface.
        """
        streams = (np.random.default_rng((seed, number)) for number in range(count))  # fewer are a prefix of more
        return [
            Touch.single(surface_points(item.mesh, self.points, rng), None, self.unit, "surface") for rng in streams
        ]
