"""Screening of a cloud before it is used: its faults are refused, kept aside or dropped."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import numpy as np
from jaxtyping import Bool, Float64

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.faults.find import find_faults
from pcsr.errors import PcsrWarning, UserError
from pcsr.geometry.checks import check_cloud

Bad: TypeAlias = Literal["refuse", "drop", "keep"]
"""Treatment of faulty points."""


@dataclass(frozen=True, eq=False)
class ScreenedCloud:
    """Cloud whose points are divided into those that computations use and those that are only kept."""

    cloud: Cloud
    """The cloud without dropped points."""
    used: Bool[np.ndarray, " n"]
    """Which of its points computations use: one at each position, without faults."""
    removed: float = 0.0
    """Standard deviation of the noise that was removed from these points, in the unit of the cloud; 0 if none was."""

    @property
    def points(self) -> Float64[np.ndarray, "m 3"]:
        """The points that computations use."""
        return self.cloud.points if self.used.all() else self.cloud.points[self.used]

    @property
    def normals(self) -> Float64[np.ndarray, "m 3"] | None:
        """The unit normals of these points; see `Cloud.normals`."""
        normals = self.cloud.normals
        return None if normals is None else normals[self.used]

    def without_kept(self, dense: Cloud) -> Cloud:
        """Return the used and new points of an upsampled cloud, which begins with the points of `cloud`."""
        if self.used.all():
            return dense
        return dense.chosen(np.r_[self.used, np.ones(len(dense) - len(self.used), bool)])


def screen(cloud: Cloud, bad: Bad = "refuse", name: str = "the cloud") -> ScreenedCloud:
    """Find the faults of a cloud, and decide which of its points are used.

    Args:
        cloud: the cloud, with coordinates of any value.
        bad: treatment of points that are not finite, of sentinels and of far outliers. "refuse" raises an error, "drop"
            removes them, "keep" leaves them in the cloud unused. Of exact duplicates the first is used; "drop" removes
            the others.
        name: name of the cloud in messages.

    Raises:
        UserError: there are faulty points and `bad` is "refuse", no point is left, or all lie on one spot.

    Warns:
        PcsrWarning: there are faulty points or duplicates; one sentence for each kind.
    """
    if bad not in get_args(Bad):
        raise UserError(f"bad is '{bad}': it must be refuse, drop or keep")
    if not len(cloud):
        raise UserError(f"{name} holds no points")
    finite = np.isfinite(cloud.points).all(axis=1)
    if not finite.any() and bad != "refuse":
        raise UserError(f"{name}: none of its {len(cloud)} points has coordinates that are all finite")
    if finite.any():
        check_cloud(cloud.points[finite], name, extent=True)
    faults = find_faults(cloud.points)
    harmful = [fault.sentence for fault in faults if fault.harmful]
    if harmful and bad == "refuse":
        raise refusal(name, harmful)
    used = np.ones(len(cloud), bool)
    for fault in faults:
        used[fault.rows] = False
        warnings.warn(remark(name, fault.sentence, bad, harmful=fault.harmful), PcsrWarning, stacklevel=3)
    if bad == "drop" and not used.all():
        cloud, used = cloud.chosen(used), np.ones(int(used.sum()), bool)
    return ScreenedCloud(cloud, used)


def refusal(name: str, sentences: Sequence[str]) -> UserError:
    """Return the error for a cloud with faults."""
    return UserError(
        f"{name}: {'; '.join(sentences)}: drop such points with --bad drop, or keep them unused with --bad keep "
        f"(from Python: bad='drop', bad='keep')"
    )


def remark(name: str, sentence: str, bad: Bad, *, harmful: bool) -> str:
    """Return the warning for one fault of a cloud: what was found, and what is done with it."""
    copies = "each position is used once" if bad != "drop" else "the copies were dropped"
    done = copies if not harmful else "dropped" if bad == "drop" else "kept, but not used"
    return f"{name}: {sentence}: {done}"


def warn_of_faults(points: Float64[np.ndarray, "n 3"], name: str) -> None:
    """Warn of sentinels and far outliers in a cloud that is used as it is.

    Warns:
        PcsrWarning: there are some; one sentence for each kind.
    """
    for fault in find_faults(points):
        if fault.harmful:
            warnings.warn(f"{name}: {fault.sentence}: they are used like all others", PcsrWarning, stacklevel=3)
