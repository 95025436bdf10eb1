"""The kind of part that chooses where to touch next."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from jaxtyping import Float, Int

from pcsr.contracts.part import Part
from pcsr.errors import UserError


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
            UserError: they are not.
        """
        scores = np.asarray(self.scores(candidates, cloud, touched))
        if scores.shape != (len(candidates),) or scores.dtype.kind not in "fiub" or not np.isfinite(scores).all():
            raise UserError(
                f"policy {type(self).__name__} gave scores of shape {scores.shape} and type {scores.dtype} for "
                f"{len(candidates)} candidates: return one finite number for each"
            )
        return scores.astype(np.float64)
