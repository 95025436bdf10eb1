"""3PU's loss: the Chamfer distance at every level of a network that goes up in levels.

Wang et al., "Patch-based Progressive 3D Point Set Upsampling", CVPR 2019. There each level has a truth of as
many points, drawn by Poisson disks. Here a level's truth are the farthest points of the whole truth, which lie like
those; the last level's is the whole. All levels are trained together from the first step and weigh the same, where the
original lets them in one by one. Its code also leaves out what is more than some times as far as the mean, since its
later levels see patches that don't quite match their truth, and adds a fiftieth of a repulsion: neither is done here.
"""

from jaxtyping import Float
from torch import Tensor

from pcsr import Objective, TouchBatch
from pcsr.contracts import UpsamplingNetwork
from pcsr.metrics.chamfer import chamfer
from pcsr.tensors import Points
from pcsr_plugins.layers.farthest import farthest


class ProgressiveChamfer(Objective):
    """The sum over the levels; of a network of one level it is the objective `chamfer`."""

    def forward(
        self, prediction: Float[Tensor, "b rn 3"], target: Float[Tensor, "b g 3"]
    ) -> dict[str, Float[Tensor, ""]]:
        """The result alone: one loss, named `chamfer`."""
        return {"chamfer": chamfer(prediction, target).mean()}

    def losses(
        self,
        network: UpsamplingNetwork,
        points: Points,
        truth: Float[Tensor, "b g 3"],
        rate: int,
        touches: TouchBatch | None = None,
    ) -> dict[str, Float[Tensor, ""]]:
        """One loss for each level, named by its points: `chamfer-512`."""
        clouds = network.stages(points, rate, touches)
        sizes = [cloud.shape[1] for cloud in clouds]
        most = max((size for size in sizes if size < truth.shape[1]), default=0)
        thinned = farthest(truth, most) if most else truth
        targets = [thinned[:, :size] if size < truth.shape[1] else truth for size in sizes]
        return {
            f"chamfer-{size}": chamfer(cloud, target).mean()
            for size, cloud, target in zip(sizes, clouds, targets, strict=True)
        }
