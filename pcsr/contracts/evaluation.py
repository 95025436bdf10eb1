"""The kinds of part that an evaluation consists of: metrics and baselines. Neither takes options."""

from typing import ClassVar

import numpy as np
from jaxtyping import Float
from torch import Tensor

from pcsr.contracts.part import Part
from pcsr.tensors import Mesh


class Metric(Part):
    """Error of a dense cloud with respect to the true one. Lower is better, and 0 is perfect.

    Examples:
        >>> class Shift(pcsr.Metric):
        ...     description = "distance of the centroids"
        ...
        ...     def measure(self, prediction, target, mesh=None):
        ...         return float((prediction.mean(0) - target.mean(0)).norm())
        >>> Shift().measure(torch.ones(5, 3), torch.ones(7, 3))
        0.0
    """

    description: ClassVar[str]
    """Definition of the metric in one line of a table."""
    scale: ClassVar[int] = 1000
    """Factor of the values in tables."""
    needs_mesh: ClassVar[bool] = False
    """Whether `measure` needs the true surface."""

    def measure(
        self, prediction: Float[Tensor, "p 3"], target: Float[Tensor, "t 3"], mesh: Mesh | None = None
    ) -> float:
        """Compute the error of one cloud, not multiplied by `scale`.

        Args:
            prediction: the predicted cloud.
            target: the true cloud; it may have another number of points.
            mesh: vertices and faces of the true surface, in the frame of the clouds; None if it is unknown.

        Raises:
            UserError: the metric is not defined for these clouds.
        """
        raise NotImplementedError


class Baseline(Part):
    """Upsampling without learning, with which networks are compared.

    Examples:
        >>> class Copies(pcsr.Baseline):
        ...     def upsample(self, points, rate, mesh, rng):
        ...         return np.repeat(points, rate, axis=0)
        >>> Copies().upsample(np.zeros((5, 3)), 4, None, np.random.default_rng(0)).shape
        (20, 3)
    """

    needs_mesh: ClassVar[bool] = False
    """Whether `upsample` needs the true surface. If so, it is a bound rather than a method."""

    def upsample(
        self, points: Float[np.ndarray, "n 3"], rate: int, mesh: Mesh | None, rng: np.random.Generator
    ) -> Float[np.ndarray, "rn 3"]:
        """Generate a dense cloud of `rate` times as many points.

        Args:
            points: the sparse cloud.
            rate: number of output points for each input point.
            mesh: vertices and faces of the true surface, in the frame of the cloud; None unless `needs_mesh`.
            rng: random generator of the object, independent of that of the truth.
        """
        raise NotImplementedError
