"""Metrics of upsampled clouds. The name of a metric states its convention, since papers use several under one name.

Examples:
    >>> list(METRICS)
    ['cd', 'hd', 'hd-pugcn', 'emd', 'p2f']
    >>> METRICS["cd"].description
    'Chamfer distance: mean squared distance to the nearest point, summed over both directions'
"""

from collections.abc import Callable
from typing import ClassVar

from jaxtyping import Float
from torch import Tensor

from pcsr.contracts import Metric
from pcsr.errors import UserError
from pcsr.metrics.chamfer import chamfer
from pcsr.metrics.emd import emd
from pcsr.metrics.hausdorff import hausdorff, hausdorff_pugcn
from pcsr.metrics.p2f import point_to_surface
from pcsr.tensors import Mesh

__all__ = ["METRICS", "Metric", "chamfer", "emd", "hausdorff", "hausdorff_pugcn", "point_to_surface"]


class NamedMetric(Metric):
    """First-party metric."""

    name: ClassVar[str]
    function: ClassVar[tuple[Callable[[Tensor, Tensor], Tensor], ...]] = ()
    """Function of two batches of clouds, in a tuple: a bare function would become a method."""

    @property
    def between_clouds(self) -> Callable[[Tensor, Tensor], Tensor] | None:
        """Function of two batches of clouds; `None` for metrics that need the mesh."""
        return None if self.needs_mesh else self.function[0]

    def __call__(
        self, prediction: Float[Tensor, "1 p 3"], target: Float[Tensor, "1 t 3"], mesh: Mesh | None = None
    ) -> float:
        """Compute the metric of a batch of one cloud."""
        return self.measure(prediction[0], target[0], mesh)

    def measure(
        self, prediction: Float[Tensor, "p 3"], target: Float[Tensor, "t 3"], mesh: Mesh | None = None
    ) -> float:
        """Compute the error of one cloud, not multiplied by `scale`.

        Raises:
            UserError: the metric needs the mesh and there is none, or it needs clouds of the same size.
            RunError: a cloud is empty, or a coordinate is not finite.
        """
        if self.between_clouds is not None:
            return float(self.between_clouds(prediction[None], target[None])[0])
        if mesh is None:
            raise UserError(f"metric '{self.name}' needs the true mesh: pass it, or leave the metric out")
        return float(point_to_surface(prediction.detach().cpu().double().numpy(), *mesh).mean())


class Chamfer(NamedMetric):
    """Chamfer distance."""

    name = "cd"
    description = "Chamfer distance: mean squared distance to the nearest point, summed over both directions"
    function = (chamfer,)


class Hausdorff(NamedMetric):
    """Hausdorff distance."""

    name = "hd"
    description = "Hausdorff distance: greatest distance to the nearest point in either direction"
    function = (hausdorff,)


class HausdorffPUGCN(NamedMetric):
    """PU-GCN's Hausdorff distance."""

    name = "hd-pugcn"
    description = (
        "PU-GCN's Hausdorff distance: greatest squared distance to the nearest point, summed over both directions"
    )
    function = (hausdorff_pugcn,)


class EarthMovers(NamedMetric):
    """Earth mover's distance."""

    name = "emd"
    description = "earth mover's distance: mean distance of the best one-to-one assignment"
    function = (emd,)


class PointToFace(NamedMetric):
    """Distance from the predicted points to the true surface."""

    name = "p2f"
    description = "point to face: mean distance of the predicted points to the true surface"
    needs_mesh = True


METRICS: dict[str, NamedMetric] = {
    kind.name: kind() for kind in (Chamfer, Hausdorff, HausdorffPUGCN, EarthMovers, PointToFace)
}
"""First-party metrics by name."""
