"""Check of a network's output."""

import numpy as np

from pcsr.errors import RunError


def check_finite(points: np.ndarray) -> None:
    """Check that the output of a network is finite.

    Raises:
        RunError: a coordinate is not finite.
    """
    if not np.isfinite(points).all():
        raise RunError("the network gave coordinates that are not finite: its weights are damaged, train it again")
