"""Where to touch: in which order the candidates of a touch are tried, and where the fingers of a grasp go."""

from typing import Annotated, Literal

import numpy as np
from jaxtyping import Float, Int
from pydantic import Field
from scipy.spatial import KDTree

from pcsr import Choice

Policy = Literal["uniform", "spread", "sparse", "grasp"]

NEIGHBOURS = 4
"""A place is as sparse as the mean distance to so many of the nearest known points."""
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
    places: Float[np.ndarray, "p 3"],
    felt: Float[np.ndarray, "f 3"],
    seen: Float[np.ndarray, "s 3"],
) -> Int[np.ndarray, " p"]:
    """Indices of the candidates, the first to be tried first. All lengths are in one unit.

    Args:
        policy: "spread": the farther from what was felt the earlier. "sparse": the fewer points, felt or seen,
            lie about a place the earlier. Otherwise the candidates stay as they were drawn, as they do for
            "spread" as long as nothing was felt.
        places: random places of the surface.
        felt: points of earlier touches.
        seen: points of the visual cloud.
    """
    if policy == "spread":
        return farthest_first(places, felt, 1)
    if policy == "sparse":
        return farthest_first(places, np.concatenate([seen, felt]), NEIGHBOURS)
    return np.arange(len(places))


def farthest_first(
    places: Float[np.ndarray, "p 3"], known: Float[np.ndarray, "k 3"], neighbours: int
) -> Int[np.ndarray, " p"]:
    """By the mean distance to the nearest few known points, descending; equals and all without any as they were."""
    if len(known) == 0 or len(places) == 0:
        return np.arange(len(places))
    distances, _ = KDTree(known).query(places, k=list(range(1, min(neighbours, len(known)) + 1)))
    return np.argsort(-distances.mean(1), kind="stable")


def opposing(
    place: Float[np.ndarray, "3"],
    frame: Float[np.ndarray, "3 3"],
    housing: tuple[float, float],
    spacing: float,
    angle: float,
) -> tuple[Float[np.ndarray, "fingers 3"], Float[np.ndarray, "3 3"]]:
    """Where the fingers opposite a thumb go, and the frame that they share (Smith et al., 2020).

    They close along the thumb's axis from the other side, side by side: the shorter sides of their housings
    are in a row.

    Args:
        place: the thumb's, in mm.
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
    return place + steps[:, None] * row, turned
