"""The check of what a network gives."""

import numpy as np

from pcsr.errors import RunError


def check_finite(points: np.ndarray) -> None:
    """Refuse output of a network that is not finite.

    Raises:
        RunError: a coordinate is not finite.
    """
    if not np.isfinite(points).all():
        raise RunError("the network gave coordinates that are not finite: its weights are damaged, train it again")
