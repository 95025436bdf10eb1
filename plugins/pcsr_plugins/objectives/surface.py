"""Coverage and accuracy as separate terms instead of the Chamfer distance. Our own.

The Chamfer distance from the new points to the true ones is for the most part the gaps between the true ones, so it
says little of whether a point lies on the surface. And where the sparse points are some of the true ones, it rewards
whoever draws new points to them. A network that learns by it comes to lie worse on smooth surfaces than interpolation
does, and less evenly (docs/accuracy.md, "PU-GAN's shapes"). Here the target-to-prediction term is the Chamfer term. The
prediction-to-target term is a point-to-plane distance (Chen and Medioni, "Object modelling by registration of multiple
range images", Image and Vision Computing 1992, Eq. 4) to a plane fitted around the nearest target point; beyond one
target spacing it is point-to-point. The spacing is the mean over the cloud, so the truth has to be evenly sampled.
"""

from jaxtyping import Float
from torch import Tensor

from pcsr import Objective
from pcsr_plugins.layers.options import Weight
from pcsr_plugins.layers.surface_distances import coverage, distances


class Surface(Objective):
    """How well the truth is covered, and how far off its planes, and off all of it, the new points are."""

    def __init__(self, *, surface: Weight = 2.0, stray: Weight = 10.0) -> None:
        """Choose what counts how much, beside a weight of 1 for the coverage.

        Args:
            surface: of the squared distance to the plane. The more, the nearer to the surface new points lie, and the
                barer are thin limbs: a candidate between their sheets goes back to where it came from.
            stray: of the squared distance beyond the truth's spacing, the mean distance from a true point to the next.
                It needs an evenly sampled truth: of another, points on the surface between true points far apart count
                as stray.
        """
        super().__init__()
        self.surface, self.stray = surface, stray

    def forward(
        self, prediction: Float[Tensor, "b rn 3"], target: Float[Tensor, "b g 3"]
    ) -> dict[str, Float[Tensor, ""]]:
        """Three losses, named `coverage`, `surface` and `stray`.

        Raises:
            UserError: the truth is a single point, or none.
        """
        height, beyond = distances(prediction, target)
        return {
            "coverage": coverage(prediction, target),
            "surface": self.surface * height.square().mean(),
            "stray": self.stray * beyond.square().mean(),
        }
