"""Effect of touch on a network: the share of the touched region's error that it removes, and error by distance."""

import math
from collections.abc import Mapping, Sequence
from typing import Annotated

import torch
from jaxtyping import Bool, Float, Int
from pydantic import BaseModel, Field, FiniteFloat, model_validator
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
EXCHANGED = "another object's"
EXCHANGED_DEFINITION = (
    "the same with the touches of another object, which tell nothing of this one: what they take off is no use of touch"
)
Distance = Annotated[FiniteFloat, Field(ge=0, lt=1e100)]
"""A squared distance of which sums are finite."""


class TouchEffect(BaseModel):
    """One network with touches and without, on the same objects, in the frame in which the truth fills the unit sphere.

    Chamfer distances are one for each object; errors are means over the truth's points of all objects, for each bin
    of `EDGES`, and None where a bin has no points.
    """

    touched: list[Distance]
    """Chamfer distance with touches."""
    plain: list[Distance]
    """Chamfer distance without touches."""
    replaced: list[Distance]
    """Chamfer distance without touches, after the touched region was replaced by the truth (`replace_region`)."""
    exchanged: list[Distance] | None = None
    """Chamfer distance with the touches of another object, which shows whether it matters what was touched. None where
    touched points are part of the cloud or of the result, in which those of another object would lie wrong; of a single
    object; and in results of pcsr 0.2 and older."""
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

    @property
    def exchanged_efficiency(self) -> float | None:
        """Touch efficiency of the touches of another object; None where they were not measured."""
        return None if self.exchanged is None else efficiency(self.exchanged, self.plain, self.replaced)

    @model_validator(mode="after")
    def _check_lengths(self) -> "TouchEffect":
        sizes = {"counts": len(self.counts), **{name: len(row) for name, row in self.errors.items()}}
        for key, found in sizes.items():
            if found != len(self.edges):
                raise ValueError(f"'{key}' has {found} values for {len(self.edges)} distances")
        return self


def efficiency(touched: Sequence[float], plain: Sequence[float], replaced: Sequence[float]) -> float | None:
    """Compute the touch efficiency (plain - touched) / (plain - replaced) from means over objects.

    0 means that touch changes nothing, and a negative value that it harms. A perfect new sampling of the touched region
    stays below 1 (`replace_region`). Values above 1 are possible where touch helps beyond the region. The value is a
    ratio of means, since objects with almost no error in the region would dominate a mean of ratios.

    Args:
        touched: Chamfer distance of each object with touches.
        plain: Chamfer distance of each object without touches.
        replaced: Chamfer distance of each object after `replace_region`.

    Returns:
        The efficiency; None where the touched region holds no error.

    Examples:
        >>> efficiency(touched=[0.75, 1.25], plain=[1.0, 2.0], replaced=[0.5, 1.0])
        0.6666666666666666
    """
    possible = math.fsum(plain) - math.fsum(replaced)
    return (math.fsum(plain) - math.fsum(touched)) / possible if possible > 0 else None


def replace_region(
    dense: Float[Tensor, "p 3"], truth: Float[Tensor, "t 3"], region: Bool[Tensor, " t"]
) -> Float[Tensor, "_ 3"]:
    """Replace the points of a cloud in the touched region by those of the true cloud.

    A point of the cloud belongs to the region if its nearest point of the truth was touched. These points are removed,
    and the touched points of the truth are added, so that the number of points may change.

    The replaced region has no error at all, whereas even a perfect new sampling of the surface has some. The touch
    efficiency of such a sampling is therefore below 1, by the ratio of its error to the network's error in the region:
    by little if the network was far off, by much if it was already close.

    Args:
        dense: the cloud.
        truth: the true cloud.
        region: mask of the points of the truth that were touched.

    Raises:
        RunError: a cloud is empty, or a coordinate is not finite.
    """
    inside = region[nearest(dense[None], truth[None])[0]]
    return torch.cat([dense[~inside], truth[region]])


def distance_bins(truth: Float[Tensor, "t 3"], touched: Float[Tensor, "m 3"]) -> Int[Tensor, " t"]:
    """Return the bin of `EDGES` for the distance of each point of the truth to the nearest touched point.

    Without touched points it is the last.

    Raises:
        RunError: the truth is empty, or a coordinate is not finite.
    """
    if not len(touched):
        return torch.full((len(truth),), len(EDGES) - 1)
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
    exchanged: Sequence[Float[Tensor, "_ 3"]] | None = None,
) -> TouchEffect:
    """Measure the effect of touch on one network.

    All clouds are in the unit sphere of the true cloud, one for each object.

    Args:
        truth: true clouds.
        touches: touched points of each object; none if no touch of it could be registered.
        regions: for each true cloud, mask of its points that were touched.
        touched: dense clouds of the network with touches.
        plain: dense clouds of the network without touches.
        others: dense clouds of baselines by name, for the errors by distance.
        name: name of the network.
        seconds: wall time for a cloud without touches.
        exchanged: dense clouds of the network with the touches of another object.

    Raises:
        RunError: a cloud is empty, or a coordinate is not finite.
    """
    replaced = [replace_region(*clouds) for clouds in zip(plain, truth, regions, strict=True)]
    bins = torch.cat([distance_bins(*clouds) for clouds in zip(truth, touches, strict=True)])
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
        exchanged=None if exchanged is None else _chamfer(exchanged, truth),
        seconds=seconds,
        edges=list(EDGES),
        counts=counts.tolist(),
        errors=errors,
    )


def _chamfer(clouds: Sequence[Float[Tensor, "_ 3"]], truth: Sequence[Float[Tensor, "t 3"]]) -> list[float]:
    return [float(chamfer(cloud[None], t[None])[0]) for cloud, t in zip(clouds, truth, strict=True)]
