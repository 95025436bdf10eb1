"""Baseline `floor`: the true surface sampled once more, the error that no upsampler can be expected to go below."""

from typing import ClassVar

import numpy as np
import trimesh
from jaxtyping import Float

from pcsr import Baseline, UserError
from pcsr.geometry.sampling import poisson_points
from pcsr.tensors import Mesh


class Floor(Baseline):
    """Blue noise on the true surface, independent of the truth.

    An upsampler may come a little below it where it keeps points of a sparse cloud that is a part of the truth.
    """

    needs_mesh: ClassVar[bool] = True

    def upsample(
        self, points: Float[np.ndarray, "n 3"], rate: int, mesh: Mesh | None, rng: np.random.Generator
    ) -> Float[np.ndarray, "rn 3"]:
        """Sample the surface.

        Raises:
            UserError: there is no mesh, or it has no area.
        """
        if mesh is None:
            raise UserError("baseline 'floor' samples the true surface, and there is no mesh: leave it out")
        return poisson_points(trimesh.Trimesh(*mesh, process=False), rate * len(points), rng)
