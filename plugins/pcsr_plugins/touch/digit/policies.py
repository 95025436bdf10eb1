"""Where to touch: in which order the candidates of a touch are tried, and where the fingers of a grasp go."""

from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float, Int
from pydantic import Field
from scipy.spatial import KDTree

from pcsr import Choice

Policy = Literal["uniform", "spread", "sparse", "grasp"]

NEIGHBOURS = 4
"""Number of nearest known points whose mean distance is a candidate's sparsity."""
OPPOSING = 3
"""Fingers that a grasp sets against its thumb."""


class PolicyOptions(Choice):
    """Which candidates are tried first, and how many."""

    use: Policy = "uniform"
    """uniform: at random. spread: far from points touched before. sparse: where the cloud and the points touched
    before are sparsest. grasp: at random, by a thumb and up to three fingers opposite to it; one grasp is one touch."""
    spacing: Annotated[float, Field(gt=0, le=1000)] = 20.0
    """Distance between the axes of a grasp's fingers, in mm."""
    tries: Annotated[int, Field(ge=1, le=10_000)] = 100
    """Candidates tried for each touch before giving up."""


def order(
    policy: Policy,
    candidates: Float[np.ndarray, "p 3"],
    touched: Float[np.ndarray, "f 3"],
    seen: Float[np.ndarray, "s 3"],
) -> Int[np.ndarray, " p"]:
    """Indices of the candidates, the first to be tried first. All lengths are in one unit.

    Args:
        policy: "spread": those farthest from touched points first. "sparse": those with the fewest points, touched or
            seen, around them first. Otherwise the candidates stay as they were drawn, as they do for
            "spread" before the first touch.
        candidates: random points of the surface.
        touched: points of earlier touches.
        seen: points of the visual cloud.
    """
    if policy == "spread":
        return farthest_first(candidates, touched, 1)
    if policy == "sparse":
        return farthest_first(candidates, np.concatenate([seen, touched]), NEIGHBOURS)
    return np.arange(len(candidates))


def farthest_first(
    candidates: Float[np.ndarray, "p 3"], known: Float[np.ndarray, "k 3"], neighbours: int
) -> Int[np.ndarray, " p"]:
    """By the mean distance to the nearest few known points, descending; equals and all without any as they were."""
    if len(known) == 0 or len(candidates) == 0:
        return np.arange(len(candidates))
    distances, _ = KDTree(known).query(candidates, k=list(range(1, min(neighbours, len(known)) + 1)))
    return np.argsort(-distances.mean(1), kind="stable")


def opposing(
    point: Float[np.ndarray, "3"],
    frame: Float[np.ndarray, "3 3"],
    housing: tuple[float, float],
    spacing: float,
    angle: float,
) -> tuple[Float[np.ndarray, "fingers 3"], Float[np.ndarray, "3 3"]]:
    """Where the fingers opposite a thumb go, and the frame that they share (Smith et al., 2020).

    They close along the thumb's axis from the other side, side by side: the shorter sides of their housings
    are in a row.

    Args:
        point: the thumb's, in mm.
        frame: the thumb's axes as columns.
        housing: its sides along x and y, in mm.
        spacing: between the fingers' axes, in mm.
        angle: direction of their row about the thumb's axis, in radians.

    Returns:
        A point on each finger's axis, the middle one's on the thumb's; their axes as columns.
    """
    row = np.cos(angle) * frame[:, 0] + np.sin(angle) * frame[:, 1]
    axis = -frame[:, 2]
    across = np.cross(axis, row)  # row, across, axis: right-handed
    turned = np.stack([row, across, axis] if housing[0] < housing[1] else [-across, row, axis], axis=-1)
    steps = (np.arange(OPPOSING) - (OPPOSING - 1) / 2) * spacing
    return point + steps[:, None] * row, turned
