"""Metrics, each under a name that says its convention: the field uses several under one."""

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


@dataclass(frozen=True)
class Metric:
    """A named convention. Lower is better for all of them.

    Examples:
        >>> prediction, target = torch.zeros(1, 2, 3), torch.tensor([[[0.0, 0, 0], [2, 0, 0]]])
        >>> pcsr.metrics.METRICS["cd"](prediction, target)
        2.0
        >>> pcsr.metrics.METRICS["p2f"].needs_mesh
        True
    """

    name: str
    description: str
    between_clouds: Callable[[Tensor, Tensor], Tensor] | None
    """Of two batches of clouds; None for a metric that needs the mesh."""
    scale: int = 1000
    """Tables show the value times this."""

    @property
    def needs_mesh(self) -> bool:
        """True if the truth is a surface rather than a cloud."""
        return self.between_clouds is None

    def __call__(
        self, prediction: Float[Tensor, "1 p 3"], target: Float[Tensor, "1 t 3"], mesh: Mesh | None = None
    ) -> float:
        """The metric of one cloud, unscaled.

        Args:
            prediction: the cloud to judge.
            target: the true cloud.
            mesh: vertices and faces of the true surface, in the frame of the clouds.

        Raises:
            UserError: the metric needs the mesh, or clouds of one size.
            RunError: a cloud is empty, or a coordinate is not finite.
        """
        if self.between_clouds is not None:
            return float(self.between_clouds(prediction, target)[0])
        if mesh is None:
            raise UserError(f"metric '{self.name}' needs the true mesh: hand it in, or leave the metric out")
        return float(point_to_surface(prediction[0].detach().cpu().double().numpy(), *mesh).mean())


_ALL = (
    Metric("cd", "Chamfer distance: mean squared distance to the nearest point, both ways summed", chamfer),
    Metric("hd", "Hausdorff distance: greatest distance to the nearest point, of both ways", hausdorff),
    Metric(
        "hd-pugcn",
        "PU-GCN's Hausdorff distance: greatest squared distances to the nearest point, both ways summed",
        hausdorff_pugcn,
    ),
    Metric("emd", "earth mover's distance: mean distance of the best one-to-one assignment", emd),
    Metric("p2f", "point to face: mean distance of the predicted points to the true surface", None),
)
METRICS = {metric.name: metric for metric in _ALL}
"""Every metric by its name."""
