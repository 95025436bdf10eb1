"""Touches that a cloud is upsampled with: read, checked, and registered to the cloud."""

import warnings
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.clouds.convert import convert
from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.errors import PcsrWarning, UserError
from pcsr.geometry.checks import check_frame
from pcsr.geometry.magnitude import exponent, scaled
from pcsr.registration import Registration, register

MOST_DISTANCE = 0.5
"""Largest distance of a touch from the cloud, in diameters of the cloud."""
MOST_SIZE = 2.0
"""Largest diameter of a touch, in diameters of the cloud."""
MOST_NAMED = 5
"""Most touches that a warning names."""

TouchesLike = str | Path | Sequence[Any] | Registration
"""Folder of a recording, `Touch` records and arrays of points, or touches that are registered already."""
CloudPoints = Float[np.ndarray, "_ 3"]


@dataclass(frozen=True)
class GivenTouches:
    """Touches in the frame and unit of a cloud."""

    touches: list[Touch | CloudPoints]
    names: list[str]
    """Name of each touch in messages."""
    pose_error: PoseError | None
    """Error of the poses; None if it is unknown."""
    as_is: bool
    """Whether no touch is registered."""
    registered_errors: list[Float[np.ndarray, " _"]] = field(default_factory=list)
    """Expected error of each point of each touch after the registration; empty if none was registered."""

    @classmethod
    def of(cls, touches: TouchesLike, pose_error: PoseError | None = None, *, as_is: bool = False) -> "GivenTouches":
        """Read touches of any kind.

        Args:
            touches: a recording's folder, `Touch` records, clouds of any kind, or a `Registration`, whose refused
                touches are left out.
            pose_error: error of the poses; that of the recording by default.
            as_is: use the poses as they are reported.

        Raises:
            UserError: the recording cannot be read, or a touch is no cloud.
        """
        if isinstance(touches, Registration):
            used = [(index, one) for index, one in enumerate(touches.touches) if one.verdict != "refused"]
            names, errors = [f"touch {index}" for index, _ in used], [one.errors for _, one in used]
            return cls([one.touch for _, one in used], names, None, True, errors)
        if isinstance(touches, str | Path):
            from pcsr.recorded import read  # here, since its layouts are slow to import

            recording = read(Path(touches))
            names = [f"touch {index} ({name})" for index, name in enumerate(recording.names)]
            return cls(list(recording.touches), names, pose_error or recording.pose_error, as_is)
        if isinstance(touches, Touch) or not isinstance(touches, Iterable):
            raise UserError(
                f"touches is a {type(touches).__name__}: give a list of touches, or the folder of a recording"
            )
        given = [touch if isinstance(touch, Touch) else np.asarray(convert(touch).cloud.points) for touch in touches]
        return cls(given, [f"touch {index}" for index in range(len(given))], pose_error, as_is)

    def points(self, power: int) -> list[CloudPoints]:
        """Return the points of each touch, divided by 2^power."""
        return [scaled(_points(touch), -power) for touch in self.touches]

    def errors(self, power: int) -> list[Float[np.ndarray, " _"]]:
        """Return the expected error of each point of each touch, divided by 2^power; NaN where it is unknown.

        It is that of the registration, which contains the sensor's, or else that of the sensor alone. It is unknown for
        arrays, and for touches that are used as they are if their sensor's is.
        """
        every = []
        for index, touch in enumerate(self.touches):
            own = touch.errors if isinstance(touch, Touch) else None
            errors = self.registered_errors[index] if self.registered_errors else own
            if errors is None or (own is None and not errors.any()):  # a pose that is taken as exact adds none
                errors = np.full(len(_points(touch)), np.nan)
            every.append(scaled(np.asarray(errors, np.float64), -power))
        return every

    def check(self, cloud: Float[np.ndarray, "n 3"]) -> None:
        """Check that the touches have points and are in the frame and unit of the cloud.

        Raises:
            UserError: a touch is empty, not finite, far from the cloud or far too large.
        """
        for error in self._mistakes(cloud).values():
            raise error

    def in_frame(self, cloud: Float[np.ndarray, "n 3"]) -> "GivenTouches":
        """Return the touches that are in the frame and unit of the cloud.

        Raises:
            UserError: no touch is.

        Warns:
            PcsrWarning: some touches are left out.
        """
        mistakes = self._mistakes(cloud)
        if len(mistakes) == len(self.touches):
            self.check(cloud)
        if mistakes:
            reasons = _listed([str(error) for error in mistakes.values()])
            warnings.warn(
                f"{len(mistakes)} of {len(self.touches)} touches are not used: {reasons}", PcsrWarning, stacklevel=3
            )
        kept = [index for index in range(len(self.touches)) if index not in mistakes]
        errors = [self.registered_errors[k] for k in kept] if self.registered_errors else []
        touches, names = [self.touches[k] for k in kept], [self.names[k] for k in kept]
        return replace(self, touches=touches, names=names, registered_errors=errors)

    def _mistakes(self, cloud: Float[np.ndarray, "n 3"]) -> dict[int, UserError]:
        """Return the errors of touches that are empty, not finite, far from the cloud or far too large, by index."""
        if not self.touches:
            return {}
        power = exponent([cloud])
        cloud = scaled(cloud, -power)
        middle = cloud.mean(0)
        radius = float(np.linalg.norm(cloud - middle, axis=1).max())
        mistakes: dict[int, UserError] = {}
        for number, touch in enumerate(self.points(power)):
            try:
                self._check_one(self.names[number], touch, middle, radius, power)
            except UserError as error:
                mistakes[number] = error
        return mistakes

    @staticmethod
    def _check_one(name: str, touch: CloudPoints, middle: Float[np.ndarray, "3"], radius: float, power: int) -> None:
        if len(touch) == 0 or not np.isfinite(touch).all():
            raise UserError(f"{name} has {len(touch)} points, which must be some and finite")
        with np.errstate(over="ignore", invalid="ignore"):  # a touch in a unit that is far too small
            size = 2 * float(np.linalg.norm(touch - touch.mean(0), axis=1).max())
            away = float(np.linalg.norm(touch - middle, axis=1).min()) - radius
        check_frame(
            name,
            "the cloud",
            distance=away,
            extent=2 * radius,
            most_distance=MOST_DISTANCE,
            size=size,
            most_size=MOST_SIZE,
            power=power,
        )

    @property
    def to_register(self) -> list[Touch]:
        """The touches that are registered to the cloud: the records, since arrays have no unit."""
        return [] if self.as_is else [touch for touch in self.touches if isinstance(touch, Touch)]

    def registration(self, cloud: Float[np.ndarray, "n 3"]) -> Registration | None:
        """Register the touches to the cloud, in their frame and unit; None if there is none to register."""
        touches = self.to_register
        return register(touches, cloud, pose_error=self.pose_error) if touches else None

    def moved(self, registration: Registration | None, *, warn: bool = True) -> "GivenTouches":
        """Return the touches as they were registered, without refused ones.

        Warns:
            PcsrWarning: touches are refused, and `warn` is set.
        """
        if registration is None:
            return self
        registered = iter(registration.touches)
        touches: list[Touch | CloudPoints] = []
        errors: list[Float[np.ndarray, " _"]] = []
        names, refused = [], []
        for touch, name in zip(self.touches, self.names, strict=True):
            one = next(registered) if isinstance(touch, Touch) else None
            if one is not None and one.verdict == "refused":
                refused.append(f"{name}: {one.reason}")
                continue
            new = touch if one is None else one.touch
            touches.append(new)
            errors.append(np.full(len(_points(new)), np.nan) if one is None else one.errors)
            names.append(name)
        if refused and warn:
            warnings.warn(
                f"{len(refused)} of {len(self.touches)} touches are refused and not used: {_listed(refused)}",
                PcsrWarning,
                stacklevel=4,
            )
        return replace(self, touches=touches, names=names, as_is=True, registered_errors=errors)


def _points(touch: Touch | CloudPoints) -> CloudPoints:
    return touch.points if isinstance(touch, Touch) else touch


def _listed(reasons: Sequence[str]) -> str:
    """Join the first reasons, with the number of further ones."""
    more = f"; and {len(reasons) - MOST_NAMED} more" if len(reasons) > MOST_NAMED else ""
    return "; ".join(reasons[:MOST_NAMED]) + more
