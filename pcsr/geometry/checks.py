"""Checks of clouds: whether an array of points is a cloud, and whether two things lie in one frame and unit."""

import numpy as np

from pcsr.errors import UserError


def check_cloud(points: np.ndarray, name: str = "the cloud", *, extent: bool = False, remedy: str = "") -> None:
    """Refuse points that are no cloud.

    Args:
        points: (n, 3).
        name: of the cloud, in messages.
        extent: whether points that all coincide are refused too.
        remedy: what can be done about points that are not finite, besides removing them.

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
    # A radius would not do: a mean of equal numbers may be off by one bit.
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
    """Refuse what lies so far from a reference, or is so large, that it must be in another frame or unit.

    Args:
        name: of what is checked, in messages: "touch 3".
        reference: what it is compared with: "the cloud".
        distance: between the two.
        extent: length of the reference.
        most_distance: the largest distance that is accepted, in extents of the reference.
        size: length of what is checked.
        most_size: the largest size that is accepted, in extents of the reference.
        power: lengths are handed over divided by two to this power, and shown multiplied by it.

    Raises:
        UserError: it is farther away or larger; the message says all lengths.
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
