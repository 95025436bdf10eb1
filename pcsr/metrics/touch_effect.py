"""Effect of touch on a network: the share of the touched region's error that it removes, and error by distance."""

import math
from collections.abc import Mapping, Sequence

import torch
from jaxtyping import Bool, Float, Int
from pydantic import BaseModel, FiniteFloat, model_validator
from torch import Tensor

from pcsr.metrics.chamfer import chamfer
from pcsr.metrics.nearest import nearest, nearest_squared

EDGES = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8)
"""Where the bins of distance to the nearest touched point begin, in radii of the unit sphere; the last has no end."""
EFFICIENCY = "touch efficiency"
DEFINITION = (
    "what touch takes off the mean Chamfer distance, as a share of what it would take off if the touched region came "
    "out without error: (without - with) / (without - touched region replaced by the truth)"
)


class TouchEffect(BaseModel):
    """One network with touches and without, on the same objects, in the frame in which the truth fills the unit sphere.

    Chamfer distances are one for each object; errors are means over the truth's points of all objects, for each bin
    of `EDGES`, and None where a bin has no points.
    """

    touched: list[FiniteFloat]
    """Chamfer distance with touches."""
    plain: list[FiniteFloat]
    """Chamfer distance without touches."""
    replaced: list[FiniteFloat]
    """Chamfer distance without touches, after the touched region was replaced by the truth (`replace_region`)."""
    seconds: float
    """Median wall time for a cloud without touches; the mean in results of pcsr 0.1.0."""
    edges: list[FiniteFloat]
    """Lower ends of the bins."""
    counts: list[int]
    """Points of the truth in each bin."""
    errors: dict[str, list[FiniteFloat | None]]
    """For each method: mean squared distance from a point of the truth to the nearest point of the method's cloud."""

    @property
    def efficiency(self) -> float | None:
        """Touch efficiency over all objects; None where the touched region holds no error."""
        return efficiency(self.touched, self.plain, self.replaced)

    @model_validator(mode="after")
    def _check_lengths(self) -> "TouchEffect":
        sizes = {"counts": len(self.counts), **{name: len(row) for name, row in self.errors.items()}}
        for key, found in sizes.items():
            if found != len(self.edges):
                raise ValueError(f"'{key}' has {found} values for {len(self.edges)} distances")
        return self


def efficiency(touched: Sequence[float], plain: Sequence[float], replaced: Sequence[float]) -> float | None:
    """(plain - touched) / (plain - replaced), of the means over objects; None where the region holds no error to take.

    0: touch changes nothing; below 0: it harms. A perfect fresh sampling of the region stays below 1
    (`replace_region`); touches that help beyond the region may exceed it. The ratio is of means, not the mean of
    ratios: an object with next to no error in its region would decide that.
    """
    possible = math.fsum(plain) - math.fsum(replaced)
    return (math.fsum(plain) - math.fsum(touched)) / possible if possible > 0 else None


def replace_region(
    dense: Float[Tensor, "p 3"], truth: Float[Tensor, "t 3"], region: Bool[Tensor, " t"]
) -> Float[Tensor, "_ 3"]:
    """Replace the points of a cloud in the touched region by those of the truth.

    A point of the cloud belongs to the region if its nearest point of the truth does. The replaced region has no error,
    which no other sampling of the surface has: even a perfect fresh sampling has a touch efficiency below 1, by the
    ratio of its error to that of the network in the region. The number of points may change.

    Raises:
        RunError: a cloud is empty, or a coordinate is not finite.
    """
    inside = region[nearest(dense[None], truth[None])[0]]
    return torch.cat([dense[~inside], truth[region]])


def distance_bins(truth: Float[Tensor, "t 3"], touched: Float[Tensor, "m 3"]) -> Int[Tensor, " t"]:
    """For each point of the truth the bin of `EDGES` that its distance to the nearest touched point falls into.

    Raises:
        RunError: a cloud is empty, or a coordinate is not finite.
    """
    distance = nearest_squared(truth[None], touched[None])[0].double().sqrt()
    return torch.bucketize(distance, torch.tensor(EDGES[1:], dtype=torch.float64), right=True)


def touch_effect(
    truth: Sequence[Float[Tensor, "t 3"]],
    touches: Sequence[Float[Tensor, "_ 3"]],
    regions: Sequence[Bool[Tensor, " t"]],
    touched: Sequence[Float[Tensor, "_ 3"]],
    plain: Sequence[Float[Tensor, "_ 3"]],
    others: Mapping[str, Sequence[Float[Tensor, "_ 3"]]],
    name: str,
    seconds: float,
) -> TouchEffect:
    """Measure the effect on one network.

    Args:
        truth: of each object, in the unit sphere; so are all the others.
        touches: the touched points of each object, at least one.
        regions: the points of each truth that belong to the touched region.
        touched: what the network makes with the touches.
        plain: what it makes without.
        others: clouds of baselines by name, for the errors by distance.
        name: the network's.
        seconds: what a cloud without touches took.

    Raises:
        RunError: a cloud is empty, or a coordinate is not finite.
    """
    replaced = [replace_region(*of_object) for of_object in zip(plain, truth, regions, strict=True)]
    bins = torch.cat([distance_bins(*of_object) for of_object in zip(truth, touches, strict=True)])
    counts = torch.bincount(bins, minlength=len(EDGES))
    errors: dict[str, list[float | None]] = {}
    for label, clouds in {name: touched, f"{name} without touch": plain, **others}.items():
        squared = [nearest_squared(t[None], cloud[None])[0] for t, cloud in zip(truth, clouds, strict=True)]
        sums = torch.bincount(bins, torch.cat(squared).double(), len(EDGES))
        errors[label] = [total / n if n else None for total, n in zip(sums.tolist(), counts.tolist(), strict=True)]
    return TouchEffect(
        touched=_chamfer(touched, truth),
        plain=_chamfer(plain, truth),
        replaced=_chamfer(replaced, truth),
        seconds=seconds,
        edges=list(EDGES),
        counts=counts.tolist(),
        errors=errors,
    )


def _chamfer(clouds: Sequence[Float[Tensor, "_ 3"]], truth: Sequence[Float[Tensor, "t 3"]]) -> list[float]:
    return [float(chamfer(cloud[None], t[None])[0]) for cloud, t in zip(clouds, truth, strict=True)]
