"""Options of the policy, and where the fingers of a grasp go."""

from typing import Annotated, ClassVar

import numpy as np
from jaxtyping import Float
from pydantic import Field

from pcsr import PartChoice

OPPOSING = 3
"""Fingers that a grasp sets against its thumb."""


class PolicyOptions(PartChoice):
    """Policy that chooses among the candidates of a touch, with its options, and how many candidates there are."""

    kind: ClassVar[str] = "policy"
    use: str = "uniform"
    """Name of the policy: uniform, spread, sparse, grasp, expected-error, or one of a plugin."""
    spacing: Annotated[float, Field(gt=0, le=1000)] = 20.0
    """Distance between the axes of a grasp's fingers, in mm."""
    tries: Annotated[int, Field(ge=1, le=10_000)] = 100
    """Candidates tried for each touch before giving up."""


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
