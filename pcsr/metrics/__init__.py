"""Metrics of upsampled clouds. The name of a metric states its convention, since papers use several under one name.

Examples:
    >>> list(METRICS)
    ['cd', 'hd', 'hd-pugcn', 'emd', 'p2f']
    >>> METRICS["cd"].description
    'Chamfer distance: mean squared distance to the nearest point, summed over both directions'
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from torch import Tensor

from pcsr.errors import UserError
from pcsr.metrics.chamfer import chamfer
from pcsr.metrics.emd import emd
from pcsr.metrics.hausdorff import hausdorff, hausdorff_pugcn
from pcsr.metrics.p2f import point_to_surface

__all__ = ["METRICS", "Metric", "chamfer", "emd", "hausdorff", "hausdorff_pugcn", "point_to_surface"]

Mesh = tuple[Float[np.ndarray, "v 3"], Int[np.ndarray, "f 3"]]
"""Vertices and faces of a triangle mesh."""


@dataclass(frozen=True)
class Metric:
    """Metric of a predicted cloud; lower is better.

    Examples:
        >>> import torch
        >>> square = torch.tensor([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]]])
        >>> METRICS["hd"](square + torch.tensor([0.0, 0.0, 0.5]), square)
        0.5
        >>> METRICS["p2f"].needs_mesh
        True
    """

    name: str
    """Name in recipes, tables and `METRICS`."""
    description: str
    """Definition in one sentence."""
    between_clouds: Callable[[Tensor, Tensor], Tensor] | None
    """Function of two batches of clouds; None for a metric that needs the mesh."""
    scale: int = 1000
    """Factor of the values in tables."""

    @property
    def needs_mesh(self) -> bool:
        """Whether the metric compares with a surface instead of a cloud."""
        return self.between_clouds is None

    def __call__(
        self, prediction: Float[Tensor, "1 p 3"], target: Float[Tensor, "1 t 3"], mesh: Mesh | None = None
    ) -> float:
        """Compute the metric of one cloud, not multiplied by `scale`.

        Args:
            prediction: the predicted cloud.
            target: the true cloud.
            mesh: vertices and faces of the true surface, in the frame of the clouds.

        Raises:
            UserError: the metric needs the mesh and there is none, or it needs clouds of the same size.
            RunError: a cloud is empty, or a coordinate is not finite.
        """
        if self.between_clouds is not None:
            return float(self.between_clouds(prediction, target)[0])
        if mesh is None:
            raise UserError(f"metric '{self.name}' needs the true mesh: pass it, or leave the metric out")
        return float(point_to_surface(prediction[0].detach().cpu().double().numpy(), *mesh).mean())


_ALL = (
    Metric("cd", "Chamfer distance: mean squared distance to the nearest point, summed over both directions", chamfer),
    Metric("hd", "Hausdorff distance: greatest distance to the nearest point in either direction", hausdorff),
    Metric(
        "hd-pugcn",
        "PU-GCN's Hausdorff distance: greatest squared distance to the nearest point, summed over both directions",
        hausdorff_pugcn,
    ),
    Metric("emd", "earth mover's distance: mean distance of the best one-to-one assignment", emd),
    Metric("p2f", "point to face: mean distance of the predicted points to the true surface", None),
)
METRICS = {metric.name: metric for metric in _ALL}
"""Metrics by name."""
