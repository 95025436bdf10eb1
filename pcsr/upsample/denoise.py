"""Denoising of a cloud: points are moved onto quadrics that are fitted to their neighbourhoods.

Many quadrics are fitted, to neighbourhoods of several sizes around each point, and each predicts where the neighbours
that it fits should be. A point moves to the weighted mean of its predictions. Quadrics whose residuals are larger than
the noise explains, as across an edge, have almost no weight; among the others, a prediction has the more weight the
smaller its variance is. So neighbourhoods are wide on flat parts, narrow on curved ones, and do not reach over edges.

The combination of fits of several sizes by their estimated risk is that of Leung and Barron, "Information theory and
mixing least-squares regressions" (IEEE Trans. Inf. Theory 2006); that of several fits which share a point is that of Xu
and Foi, "Anisotropic denoising of 3D point clouds by aggregation of multiple surface-adaptive estimates" (IEEE TVCG
2021). As in bilateral filters (Digne and de Franchis, "The bilateral filter for point clouds", IPOL 2017), a second set
of fits is restricted to neighbours whose normals agree.
"""

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from pcsr.geometry.frames import OwnFrame
from pcsr.geometry.magnitude import exponent, scaled
from pcsr.geometry.patches import cells
from pcsr.tensors import CloudArray
from pcsr.threads import threads
from pcsr.upsample.dense import ALONE
from pcsr.upsample.local_fits import CUT, TERMS, LocalFits
from pcsr.upsample.noise_level import noise_level
from pcsr.workers import WorkerPool

SIZES = (12, 17, 24, 34, 48, 68, 96)
"""Numbers of points that quadrics are fitted to."""
AGREE = 0.8
"""Least cosine of the angle between normals that agree."""
FEWEST = 10
"""Least number of neighbours that agree."""
LEVERAGE = 0.02
"""Least variance of a prediction, in variances of the noise."""
TRUST = 1.5
"""Exponent of the variance in the weight of a prediction."""
STAY = 0.3
"""Weight of the given position of a point. Perfect fits to 12 points have weights of about 3."""
CELL = 1024
"""Number of neighbourhoods that are fitted at once. It bounds the memory."""
COLUMNS = 10
"""Sums for each point: of the weights, of the weighted shifts, and of the weighted products of normals."""


@dataclass(frozen=True)
class Denoised:
    """Denoised cloud."""

    points: Float[np.ndarray, "n 3"]
    """The points, in the order of the given ones."""
    level: float
    """Standard deviation of the noise, given or estimated, in the unit of the cloud; 0 if none was found."""
    moved: int
    """Number of points that moved."""
    mean: float
    """Mean distance by which they moved."""


@threads(1)
def denoise(
    points: Float[np.ndarray, "n 3"],
    level: float | None = None,
    *,
    pool: WorkerPool = ALONE,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> Denoised:
    """Move the points of a noisy cloud onto its surface.

    The result is equivariant to rotation, translation and scaling up to rounding, and independent of the order of the
    points. Points that no quadric fits, such as stray points and those of thin wires, stay.

    Args:
        points: the cloud, (n 3), in any frame and unit; finite, without duplicates.
        level: standard deviation of the noise across the surface, in the unit of the cloud; estimated by default.
        pool: processes that fit the quadrics.
        advance: called with the number of fits that are done and the number of all fits.

    Examples:
        >>> from pcsr.upsample.denoise import denoise
        >>> rng = np.random.default_rng(0)
        >>> floor = np.column_stack([rng.uniform(0, 30, (900, 2)), rng.normal(0, 0.3, 900)])
        >>> bool(denoise(floor).points[:, 2].std() < 0.12)
        True
    """
    if len(points) < SIZES[0]:
        return Denoised(points, level or 0.0, 0, 0.0)
    power = exponent([points])
    cloud = scaled(points, -power)
    frame = OwnFrame.of(cloud)
    local = frame.normalize(cloud)
    order = np.lexsort(local.T)
    local = local[order]
    unit = float(np.ldexp(frame.radius, power))
    noise = noise_level(local) if level is None else level / unit
    if noise == 0:
        return Denoised(points, 0.0, 0, 0.0)
    done = itertools.count(1)
    every, agreeing = (np.zeros((len(local), COLUMNS)) for _ in range(2))
    tree, groups = cKDTree(local), list(cells(local, CELL))
    normals = None
    for sums in every, agreeing:
        for rows, found in pool.map(_predict, _tasks(local, tree, groups, noise, normals)):
            sums[rows] += found
            advance(next(done), 2 * len(groups))
        normals = _normals(every)
    weight, shift = (every + agreeing)[:, 0], (every + agreeing)[:, 1:4]
    shift /= STAY + weight[:, None]
    by = np.zeros_like(cloud)
    by[order] = scaled(shift * frame.radius @ frame.axes.T, power)
    distance = np.linalg.norm(shift, axis=1) * unit
    moved = distance > 0
    mean = float(distance[moved].mean()) if moved.any() else 0.0
    return Denoised(points + by, noise * unit, int(moved.sum()), mean)


@dataclass(frozen=True)
class _Task:
    """Neighbourhoods of one cell of the cloud."""

    rows: Int[np.ndarray, " m"]
    """Rows of the cloud that are in a neighbourhood."""
    points: Float[np.ndarray, "m 3"]
    normals: Float[np.ndarray, "m 3"] | None
    """Normals that must agree; None fits all neighbours."""
    index: Int[np.ndarray, "c k"]
    """Neighbours of each point of the cell, itself first, as indices of `points`."""
    level: float


def _tasks(
    points: CloudArray,
    tree: cKDTree,
    groups: Sequence[Int[np.ndarray, " _"]],
    level: float,
    normals: CloudArray | None,
) -> Iterator[_Task]:
    for group in groups:
        nearest = tree.query(points[group], k=min(SIZES[-1], len(points)))[1]
        rows, index = np.unique(nearest, return_inverse=True)
        around = None if normals is None else normals[rows]
        yield _Task(rows, points[rows], around, index.reshape(nearest.shape), level)


@threads(1)  # a Dask worker sets its own number of threads
def _predict(task: _Task) -> tuple[Int[np.ndarray, " m"], Float[np.ndarray, "m 10"]]:
    """Return the rows of a task, and their sums over its fits."""
    sums = np.zeros((len(task.rows), COLUMNS))
    for size in SIZES:
        if size > task.index.shape[1]:
            break
        index = task.index[:, :size]
        chosen = np.ones(index.shape, bool)
        if task.normals is not None:
            own, others = task.normals[index[:, 0]], task.normals[index]
            chosen = np.abs(others @ own[..., None])[..., 0] > AGREE
        fits = LocalFits.of(task.points[index] - task.points[index[:, :1]], chosen, task.level)
        weight = _plausibility(fits, chosen, task.level)[:, None] * fits.fitted
        weight /= np.maximum(fits.leverage, LEVERAGE) ** TRUST
        shift = -(weight * fits.residual)[..., None] * fits.normal
        x, y, z = np.moveaxis(fits.normal, -1, 0)
        products = (weight * one for one in (x * x, x * y, x * z, y * y, y * z, z * z))
        for column, values in enumerate((weight, *np.moveaxis(shift, -1, 0), *products)):
            sums[:, column] += np.bincount(index.ravel(), values.ravel(), len(sums))
    return task.rows, sums


def _plausibility(fits: LocalFits, chosen: Bool[np.ndarray, "c k"], level: float) -> Float[np.ndarray, " c"]:
    """Return a factor for each quadric, 1 where noise explains its residuals: their sum of squares is chi-square."""
    count = chosen.sum(1)
    freedom = np.maximum(count - TERMS, 1)
    squares = np.square(np.clip(fits.residual / level, -CUT, CUT))
    excess = np.maximum(0, (squares * chosen).sum(1) - freedom) / np.sqrt(2 * freedom)
    factor: Float[np.ndarray, " c"] = np.exp(-np.square(excess) / 2) * (count >= FEWEST)
    return factor


def _normals(sums: Float[np.ndarray, "n 10"]) -> Float[np.ndarray, "n 3"]:
    """Return the direction that the normals at each point have in common; 0 where there is none."""
    xx, xy, xz, yy, yz, zz = sums[:, 4:].T
    products = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1).reshape(-1, 3, 3)
    common = np.linalg.eigh(products)[1][..., -1]
    normals: Float[np.ndarray, "n 3"] = np.where(sums[:, :1] > 0, common, 0)
    return normals
