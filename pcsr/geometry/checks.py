"""Checks of clouds: finite coordinates, an extent, and a common frame and unit."""

import numpy as np

from pcsr.errors import UserError


def check_cloud(points: np.ndarray, name: str = "the cloud", *, extent: bool = False, remedy: str = "") -> None:
    """Check that points are a cloud.

    Args:
        points: array (n, 3).
        name: name of the cloud in messages.
        extent: whether it is an error that all points coincide.
        remedy: remedy for points that are not finite, besides removing them.

    Raises:
        UserError: there are no points, a coordinate is not finite, or all points coincide.
    """
    if not len(points):
        raise UserError(f"{name} holds no points")
    bad = int((~np.isfinite(points).all(axis=1)).sum())
    if bad:
        raise UserError(
            f"{name}: {bad} of {len(points)} points have a coordinate that is not finite: remove them{remedy}"
        )
    # The mean of equal numbers may differ from them by one bit, so a radius of 0 is no criterion.
    if extent and (points == points[0]).all():
        raise UserError(
            f"all {len(points)} points of {name} lie on one spot, {points[0].tolist()}: a cloud needs an extent"
        )


def check_frame(
    name: str,
    reference: str,
    *,
    distance: float,
    extent: float,
    most_distance: float,
    size: float = 0.0,
    most_size: float = np.inf,
    power: int = 0,
) -> None:
    """Check that an object is in the frame and unit of a reference: not too far away, and not too large.

    Args:
        name: name of the object in messages, such as "touch 3".
        reference: name of the reference in messages, such as "the cloud".
        distance: distance between object and reference.
        extent: length of the reference.
        most_distance: largest accepted distance, in extents of the reference.
        size: length of the object.
        most_size: largest accepted size, in extents of the reference.
        power: binary exponent by which the lengths were scaled down; messages show them multiplied by 2^power.

    Raises:
        UserError: the object is farther away or larger. The message names all lengths.
    """
    if distance <= most_distance * extent and size <= most_size * extent:
        return
    with np.errstate(over="ignore"):
        apart, across, whole = np.ldexp([max(distance, 0.0), size, extent], power)
    how_large = f"is {across:.4g} across and " if most_size < np.inf else ""
    raise UserError(
        f"{name} {how_large}lies {apart:.4g} away from {reference}, which is {whole:.4g} across: it is in another "
        f"unit or frame; bring it into that of {reference}"
    )
