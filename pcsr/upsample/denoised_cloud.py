"""Denoising of a screened cloud: its used points are moved, and with them the copies that are not used."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from pcsr.clouds.faults import ScreenedCloud
from pcsr.errors import UserError
from pcsr.upsample.denoise import Denoised, denoise
from pcsr.upsample.dense import ALONE
from pcsr.workers import WorkerPool

COPY = 0.01
"""A point that is not used is a copy of a used point if it is closer to it than this, in standard deviations."""


def denoise_cloud(
    given: ScreenedCloud,
    level: object,
    *,
    pool: WorkerPool = ALONE,
    advance: Callable[[int, int], None] = lambda done, total: None,
) -> tuple[ScreenedCloud, Denoised]:
    """Move the used points of a cloud onto its surface; columns and the order of rows stay.

    Args:
        given: the cloud. Copies of used points move with them; other points that are not used stay.
        level: standard deviation of the noise in the unit of the cloud; True estimates it.
        pool: processes that fit the surface.
        advance: called with the number of steps that are done and the number of all steps.

    Returns:
        The cloud with moved points, and the result for its used points.

    Raises:
        UserError: the level is not a positive number, or larger than the cloud.
    """
    known = None if level is True else _checked(level, given)
    result = denoise(given.points, known, pool=pool, advance=advance)
    if result.moved == 0:
        return given, result
    points = given.cloud.points.copy()
    unused = np.flatnonzero(~given.used & np.isfinite(points).all(1))
    if len(unused):
        distance, nearest = cKDTree(given.points).query(points[unused])
        copies = distance <= COPY * result.level
        points[unused[copies]] = result.points[nearest[copies]]
    points[given.used] = result.points
    return ScreenedCloud(replace(given.cloud, points=points), given.used, result.level), result


def _checked(level: object, given: ScreenedCloud) -> float:
    """Return a level as a float.

    Raises:
        UserError: it is not a positive number, or larger than the cloud.
    """
    size = float(np.ptp(given.points, axis=0).max())
    remedy = "give the standard deviation of the noise in the cloud's unit, or none to have it estimated"
    if isinstance(level, bool) or not isinstance(level, int | float | np.number):
        raise UserError(f"denoise is {level!r}: it must be True, False or a number: {remedy} (denoise=True)")
    try:
        number = float(level)
    except OverflowError:
        number = np.inf
    if not number > 0:
        raise UserError(f"--denoise {number:g}: it must be more than 0: {remedy} (denoise=True)")
    if number >= size:
        raise UserError(f"--denoise {number:g}: the cloud is only {size:.4g} long: {remedy} (denoise=True)")
    return number
