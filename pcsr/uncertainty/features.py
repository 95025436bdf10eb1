"""Features of new points from which their errors are predicted. Lengths are in local spacings.

Each is invariant to rotation, translation and scaling, and to the order of the points. They compare a new point with
planes and quadrics that are fitted to the known points around it, with the other new points, and with the residuals of
such fits in the whole patch.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.geometry.frames import principal_axes
from pcsr.tensors import CloudArray
from pcsr.upsample.gaps import spacing
from pcsr.upsample.local_fits import TERMS, LocalFits, quadric_terms
from pcsr.upsample.neighbours import Neighbours
from pcsr.upsample.noise import AROUND, Quadrics
from pcsr.upsample.noise_level import noise_level

NEAREST = 6
"""Number of nearest known points whose fits are compared with a new point."""
BESIDE = 12
"""Number of nearest points, known or new, that a plane is fitted to."""
FEW = 10
"""Number of points of the smallest fits: they reach over few edges, so that what they leave is noise."""
SAMPLE = 1024
"""Largest number of neighbourhoods by which the noise of a patch is estimated."""
LEAST = 1e-3
"""Lengths, in spacings, below which logarithms change little."""
TYPICAL = ("quadric", "plane", "off new")
"""Features whose median over the new points tells how well the upsampling method does on this cloud."""
PREDICTED = "predicted"
"""Name of the feature that points of some networks have alone: the error that the network itself predicts."""
QUANTILES = (0.02, 0.1, 0.5, 0.9)
"""Quantiles of residuals over the patch: the smallest ones tell noise from details."""
FARTHEST = 5.0
"""Largest distance from a quadric, in spacings: far from its points it is arbitrary."""


@dataclass(frozen=True)
class Patch:
    """Known points of a part of a cloud, and the new points on it."""

    points: CloudArray
    """The known points, (n 3), in any frame and unit."""
    new: CloudArray
    """The new points, (m 3), of the known points and of those next to them."""
    removed: float = 0.0
    """Standard deviation of the noise that was removed from the known points; 0 if they are as they were measured."""

    @cached_property
    def neighbours(self) -> Neighbours:
        """The known points with their nearest points."""
        return Neighbours.of(self.points)

    @cached_property
    def unit(self) -> Float[np.ndarray, " n"]:
        """Local spacing at each known point; that of duplicates is the smallest one of others."""
        unit = spacing(self.neighbours)
        positive: Float[np.ndarray, " n"] = np.maximum(unit, unit[unit > 0].min(initial=1.0))
        return positive

    @cached_property
    def small_planes(self) -> Float[np.ndarray, " n"]:
        """Standard deviation of the `FEW` nearest points around their plane, in spacings."""
        offsets = self._few
        centred = offsets - offsets.mean(1, keepdims=True)
        least = np.maximum(np.linalg.eigvalsh(centred.mT @ centred)[:, 0], 0)
        deviation: Float[np.ndarray, " n"] = np.sqrt(least / (FEW - 3))
        return deviation

    @cached_property
    def small_quadrics(self) -> Float[np.ndarray, " n"]:
        """Standard deviation of the `FEW` nearest points around their quadric, in spacings."""
        squares = np.square(LocalFits.of(self._few).residual).sum(1)
        deviation: Float[np.ndarray, " n"] = np.sqrt(squares / (FEW - TERMS))
        return deviation

    @property
    def _few(self) -> Float[np.ndarray, "n k 3"]:
        offsets = self.points[self.neighbours.index[:, :FEW]] - self.points[:, None]
        few: Float[np.ndarray, "n k 3"] = offsets / self.unit[:, None, None]
        return few

    @cached_property
    def level(self) -> float:
        """Estimated noise of the known points; 0 where it does not differ from details."""
        along = self.points @ principal_axes(self.points)[:, 0]  # an order that follows from the shape
        return noise_level(self.points[np.argsort(along, kind="stable")], SAMPLE)


def features(
    patch: Patch, chosen: Int[np.ndarray, " c"]
) -> tuple[dict[str, Float[np.ndarray, " c"]], Float[np.ndarray, " c"]]:
    """Compute the features of some of the new points.

    Args:
        patch: known and new points; at least 16 known ones.
        chosen: rows of the new points.

    Returns:
        The features by name, and the local spacing at each chosen point, which is their unit.
    """
    new = patch.new[chosen]
    distance, index = patch.neighbours.tree.query(new, k=NEAREST)
    unit = patch.unit[index[:, 0]]
    quadrics = Quadrics.fit(patch.neighbours, patch.unit)
    around = _of_fits(patch, quadrics, new, index, unit) | _of_new_points(patch, chosen, unit)
    found = {
        **around,
        **_of_neighbours(patch, quadrics, new, distance, index, unit),
        **{f"typical {name}": np.full(len(new), np.median(around[name])) for name in TYPICAL},
        **{name: np.full(len(new), value) for name, value in _of_patch(patch, quadrics).items()},
        "level": _log(patch.level / unit, 10 * LEAST),
        "removed": _log(patch.removed / unit, 10 * LEAST),
    }
    return found, unit


def of_prediction(predicted: Float[np.ndarray, " c"], unit: Float[np.ndarray, " c"]) -> Float[np.ndarray, " c"]:
    """Compute the feature `PREDICTED` from the errors that a network predicts, and the local spacings."""
    return _log(predicted / unit)


def _of_fits(
    patch: Patch, quadrics: Quadrics, new: CloudArray, index: Int[np.ndarray, "c k"], unit: Float[np.ndarray, " c"]
) -> dict[str, Float[np.ndarray, " c"]]:
    """Distances from the quadrics and tangent planes of the nearest known points, and residuals of these fits."""
    of_fit = patch.unit[index]
    offsets = (new[:, None] - patch.points[index]) / of_fit[..., None]
    local = (offsets[:, :, None] @ quadrics.axes[index])[:, :, 0]
    scale = of_fit / unit[:, None]
    over_planes = np.abs(local[..., 0]) * scale
    terms = quadric_terms(local[..., 1], local[..., 2])
    heights = local[..., 0] - (terms * quadrics.coefficients[index]).sum(-1)
    over_quadrics = np.minimum(np.abs(heights) * scale, FARTHEST)
    residuals = quadrics.residual[index] * scale
    return {
        **_spread("quadric", over_quadrics),
        **_spread("plane", over_planes),
        **_spread("residual", residuals),
        **_spread("small plane", patch.small_planes[index] * scale),
        **_spread("small quadric", patch.small_quadrics[index] * scale),
        "flatness": _log(quadrics.flatness[index[:, 0]], LEAST / 10),
    }


def _of_neighbours(
    patch: Patch,
    quadrics: Quadrics,
    new: CloudArray,
    distance: Float[np.ndarray, "c k"],
    index: Int[np.ndarray, "c k"],
    unit: Float[np.ndarray, " c"],
) -> dict[str, Float[np.ndarray, " c"]]:
    """Distances from the nearest known points, their evenness, and the turning of the normal among them."""
    normals = quadrics.axes[index, :, 0]
    cosines = np.abs(normals[:, 1:] @ normals[:, 0, :, None])[..., 0]
    around = np.log(patch.unit)[patch.neighbours.index[index[:, 0], :AROUND]]
    return {
        "nearest": _log(distance[:, 0] / unit),
        "farthest": _log(distance[:, -1] / unit),
        "one side": np.linalg.norm(new - patch.points[index].mean(1), axis=1) / unit,
        "turn": _log(1 - cosines.min(1)),
        "uneven": around.std(1),
        "density": np.log(unit / np.median(patch.unit)),
    }


def _of_new_points(
    patch: Patch, chosen: Int[np.ndarray, " c"], unit: Float[np.ndarray, " c"]
) -> dict[str, Float[np.ndarray, " c"]]:
    """Distances from the plane through the nearest points, known or new, and roughness of these."""
    every = np.concatenate([patch.points, patch.new])
    distance, index = cKDTree(every).query(patch.new[chosen], k=min(BESIDE + 1, len(every)))
    offsets = every[index[:, 1:]] - every[index[:, :1]]
    middle = offsets.mean(1)
    centred = offsets - middle[:, None]
    variances, axes = np.linalg.eigh(centred.mT @ centred)
    least = np.maximum(variances[:, 0], 0)
    off, rough = np.abs((middle * axes[..., 0]).sum(-1)) / unit, np.sqrt(least / BESIDE) / unit
    flatness = np.divide(least, variances[:, 1], out=np.ones(len(least)), where=variances[:, 1] > 0)
    return {
        "off new": _log(off),
        "rough new": _log(rough),
        "flatness new": _log(flatness, LEAST / 10),
        "next": _log(distance[:, 1] / unit),
        "reach": _log(distance[:, -1] / unit),
    }


def _of_patch(patch: Patch, quadrics: Quadrics) -> dict[str, float]:
    """Quantiles of residuals over the patch, its evenness, and its evidence of noise."""
    around_planes = np.sqrt(np.maximum(quadrics.variances[:, 0], 0) / AROUND)
    residuals = {
        "residuals": quadrics.residual,
        "planes": around_planes,
        "small planes": patch.small_planes,
        "small quadrics": patch.small_quadrics,
    }
    quantiles = {name: _log(np.quantile(of, QUANTILES)) for name, of in residuals.items()}
    return {
        **{
            f"{name} {q}": float(value)
            for name, of in quantiles.items()
            for q, value in zip(QUANTILES, of, strict=True)
        },
        "evenness": float(np.log(patch.unit).std()),
        "noisy": quadrics.noisy(),
    }


def _spread(name: str, values: Float[np.ndarray, "c k"]) -> dict[str, Float[np.ndarray, " c"]]:
    """Logarithms of the value at the nearest point, and of the smallest, median and largest one."""
    summaries = {"": values[:, 0], " least": values.min(1), " median": np.median(values, 1), " most": values.max(1)}
    return {f"{name}{which}": _log(value) for which, value in summaries.items()}


def _log(values: Float[np.ndarray, "*n"], least: float = LEAST) -> Float[np.ndarray, "*n"]:
    logarithm: Float[np.ndarray, "*n"] = np.log(np.maximum(values, 0) + least)
    return logarithm
