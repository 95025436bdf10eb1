"""Error of each point of a predicted cloud, for display."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from pcsr.run_files import Cloud

SCALE = 1000
"""Factor by which errors are multiplied for display."""


def distance(prediction: Float[np.ndarray, "n 3"], truth: Cloud) -> Float[np.ndarray, " n"]:
    """Distance of each predicted point to the nearest true point, in the unit of the clouds."""
    return np.asarray(cKDTree(truth.astype(np.float64)).query(prediction.astype(np.float64), workers=1)[0])


def scale_end(errors: Sequence[Float[np.ndarray, " _"]]) -> float:
    """Error at the end of a colour scale: the 99th percentile, so that outliers do not set it; 1 if that is 0."""
    return float(np.percentile(np.concatenate(errors), 99)) or 1.0
