"""The kind of part that chooses where to touch next."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float, Int

from pcsr.contracts.part import Part
from pcsr.errors import PcsrError, UserError


@dataclass(frozen=True)
class Fingertip:
    """Outline of a tactile sensor. All lengths are in mm; x is the width and y the height.

    Examples:
        >>> digit = pcsr.Fingertip("digit", gel=(16.0, 12.0), housing=(27.0, 18.0), protrusion=2.0)
        >>> digit.press
        (0.5, 1.5)
    """

    name: str
    """Name of the sensor."""
    gel: tuple[float, float]
    """Sides of the part of the face that the sensor sees."""
    housing: tuple[float, float]
    """Sides of the housing around it."""
    protrusion: float
    """How far the face stands out of the housing."""
    press: tuple[float, float] = (0.5, 1.5)
    """Least and greatest depth to which the face is pressed."""
    least_area: float = 17.5
    """Least contact in mm² that makes a touch."""

    def __post_init__(self) -> None:
        """Check the lengths.

        Raises:
            UserError: a length is not finite or has the wrong sign, or the greatest press is less than the least.
        """
        for name, sides in (("gel", self.gel), ("housing", self.housing)):
            if len(sides) != 2 or not all(np.isfinite(side) and side > 0 for side in sides):
                raise UserError(f"fingertip '{self.name}': {name} is {sides}: give two sides in mm")
        if len(self.press) != 2 or not 0 <= self.press[0] <= self.press[1] < np.inf:
            raise UserError(
                f"fingertip '{self.name}': press is {self.press}: give the least depth in mm, then the greatest"
            )
        for name in ("protrusion", "least_area"):
            if not 0 <= getattr(self, name) < np.inf:
                raise UserError(f"fingertip '{self.name}': {name} is {getattr(self, name)}: give a number from 0 on")


@dataclass(frozen=True)
class TouchCandidates:
    """Poses among which a policy chooses, in mm, in the frame of the cloud.

    In simulation they are drawn from the true surface, otherwise from the one guessed from the cloud.

    Examples:
        >>> tip = pcsr.Fingertip("digit", (16.0, 12.0), (27.0, 18.0), 2.0)
        >>> candidates = pcsr.TouchCandidates(np.zeros((2, 3)), np.stack([np.eye(3)] * 2), np.ones(2), tip)
        >>> len(candidates)
        2
    """

    points: Float[np.ndarray, "p 3"]
    """Points of the surface at which the axis of the sensor aims."""
    frames: Float[np.ndarray, "p 3 3"]
    """Axes of the sensor as columns; z points away from the object, and the finger approaches along -z."""
    presses: Float[np.ndarray, " p"]
    """Depth to which the finger is pressed."""
    fingertip: Fingertip
    """Outline of the sensor."""
    surface: Float[np.ndarray, "s 3"] | None = None
    """Points drawn evenly from the surface on which the candidates are; None: those of the candidates are."""

    def __len__(self) -> int:
        return len(self.points)


class Policy(Part):
    """Chooses where to touch next: it scores candidates by the cloud and by the touches so far.

    A policy never sees the object itself. All lengths are in mm.

    Examples:
        >>> class Highest(pcsr.Policy):
        ...     def scores(self, candidates, cloud, touched):
        ...         return candidates.points[:, 2]
        >>> tip = pcsr.Fingertip("digit", (16.0, 12.0), (27.0, 18.0), 2.0)
        >>> points = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 3.0]])
        >>> candidates = pcsr.TouchCandidates(points, np.stack([np.eye(3)] * 2), np.ones(2), tip)
        >>> Highest().order(candidates, np.zeros((16, 3)), np.zeros((0, 3)))
        array([1, 0])
    """

    grasps: ClassVar[bool] = False
    """Whether a touch is a grasp: a simulated hand then sets further fingers opposite to the first."""
    uses_cloud: ClassVar[bool] = True
    """Whether the scores depend on the cloud. If so, a cloud with coordinates that are not finite is refused."""

    def scores(
        self,
        candidates: TouchCandidates,
        cloud: Float[np.ndarray, "n 3"],
        touched: Float[np.ndarray, "f 3"],
    ) -> Float[np.ndarray, " p"]:
        """Score the candidates: the one with the highest score is touched first.

        Args:
            candidates: poses to choose from, at least one.
            cloud: points that the camera sees.
            touched: points of all earlier touches.

        Returns:
            A finite score for each candidate. Candidates of equal scores keep their order. If `error` is not None, the
            scores are expected gains: what a touch takes off the Chamfer distance, in mm².
        """
        raise NotImplementedError

    def error(
        self,
        candidates: TouchCandidates,
        cloud: Float[np.ndarray, "n 3"],
        touched: Float[np.ndarray, "f 3"],
    ) -> float | None:
        """Return the expected Chamfer distance in mm² before the next touch; None, the default, without expectation."""
        return None

    def order(
        self,
        candidates: TouchCandidates,
        cloud: Float[np.ndarray, "n 3"],
        touched: Float[np.ndarray, "f 3"],
    ) -> Int[np.ndarray, " p"]:
        """Return the indices of the candidates by descending score. Policies override `scores`, not this.

        Raises:
            UserError: the scores are not one finite number for each candidate.
        """
        if len(candidates) == 0:
            return np.arange(0)
        return np.argsort(-self.checked_scores(candidates, cloud, touched), kind="stable")

    def checked_scores(
        self,
        candidates: TouchCandidates,
        cloud: Float[np.ndarray, "n 3"],
        touched: Float[np.ndarray, "f 3"],
    ) -> Float[np.ndarray, " p"]:
        """Return `scores` if they are one finite number for each candidate.

        Raises:
            UserError: they are not, or the policy failed, for instance since it changed its arguments.
        """
        scores = self._asked(self.scores, candidates, cloud, touched)
        try:
            found = np.asarray(scores)
        except ValueError:  # rows of different lengths
            found = np.asarray(None)
        if found.shape != (len(candidates),) or found.dtype.kind not in "fiub" or not np.isfinite(found).all():
            raise UserError(
                f"policy {type(self).__name__} gave scores of shape {found.shape} and type {found.dtype} for "
                f"{len(candidates)} candidates: return one finite number for each"
            )
        return found.astype(np.float64)

    def checked_error(
        self,
        candidates: TouchCandidates,
        cloud: Float[np.ndarray, "n 3"],
        touched: Float[np.ndarray, "f 3"],
    ) -> float | None:
        """Return `error` if it is None or a finite number from 0 on.

        Raises:
            UserError: it is not, or the policy failed.
        """
        error = self._asked(self.error, candidates, cloud, touched)
        if error is None:
            return None
        if not isinstance(error, int | float | np.integer | np.floating) or not 0 <= error < np.inf:
            raise UserError(
                f"policy {type(self).__name__} expects an error of {error!r}: return mm² from 0 on, or None"
            )
        return float(error)

    def _asked(
        self,
        method: Callable[..., Any],
        candidates: TouchCandidates,
        cloud: Float[np.ndarray, "n 3"],
        touched: Float[np.ndarray, "f 3"],
    ) -> Any:
        """Call a method of the policy with arrays that cannot be changed."""
        fixed = TouchCandidates(
            _read_only(candidates.points),
            _read_only(candidates.frames),
            _read_only(candidates.presses),
            candidates.fingertip,
            None if candidates.surface is None else _read_only(candidates.surface),
        )
        try:
            return method(fixed, _read_only(cloud), _read_only(touched))
        except PcsrError:
            raise
        except Exception as error:
            what = f"{type(self).__name__}.{method.__name__}"
            raise UserError(f"policy {what} failed: {type(error).__name__}: {error}") from error


def _read_only(array: np.ndarray) -> np.ndarray:
    view = array.view()
    view.flags.writeable = False
    return view
