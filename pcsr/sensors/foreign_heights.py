"""Height maps that other programs integrated from slopes, corrected for their integration.

gs_sdk and GelSight's gsrobotics solve the Poisson equation of the slopes by a cosine transform, as
`pcsr.sensors.integration` does, but divide each mode by the eigenvalue of the next one. gs_sdk, and gsrobotics in its
older version, also take the difference over two pixels for that over one, which doubles the heights.
"""

from typing import Literal, get_args

import numpy as np
from jaxtyping import Float
from scipy import fft

from pcsr.errors import UserError

Integration = Literal["exact", "gs_sdk", "gsrobotics"]
"""Program by which heights were integrated; `exact` for heights that are right as they are."""
GAINS = {"gs_sdk": 2.0, "gsrobotics": 1.0}
"""Factor of the heights beside that of the eigenvalues."""
INTEGRATIONS: tuple[str, ...] = get_args(Integration)


def corrected(heights: Float[np.ndarray, "h w"], integration: Integration) -> Float[np.ndarray, "h w"]:
    """Return a height map of mean 0 that is to scale, from one that a program integrated.

    Each mode of the cosine transform is multiplied by the ratio of the next mode's eigenvalue and its own. For gs_sdk
    the result is the least-squares surface of the slopes where these are 0 at the edges of the image. For gsrobotics,
    which takes the slope at a pixel for that half a pixel before it, the surface lies up to half a pixel to the left
    of its place and above it.

    Args:
        heights: height of each pixel of the whole image, in any unit; they may be a difference of two maps.
        integration: the program. Heights that are `exact` are returned as they are.

    Raises:
        UserError: a height is not finite.

    Examples:
        >>> from pcsr.sensors.foreign_heights import corrected
        >>> too_low = np.cos(np.pi * (np.arange(320) + 0.5) / 320) * np.ones((240, 1))
        >>> print(f"{corrected(too_low, 'gsrobotics').max():.2f}")
        5.78
    """
    if integration == "exact":
        return heights
    if not np.isfinite(heights).all():
        raise UserError(
            f"integration: the heights of {integration} can be corrected only for a whole image, and "
            f"{np.count_nonzero(~np.isfinite(heights))} of its {heights.size} pixels are not finite"
        )
    own, following = _eigenvalues(heights.shape, 0), _eigenvalues(heights.shape, 1)
    own[0, 0] = 1  # the mean, which slopes do not determine
    modes = fft.dctn(heights, norm="ortho") * following / (GAINS[integration] * own)
    modes[0, 0] = 0
    surface: Float[np.ndarray, "h w"] = fft.idctn(modes, norm="ortho")
    return surface


def _eigenvalues(shape: tuple[int, ...], first: int) -> Float[np.ndarray, "h w"]:
    """Return the eigenvalues of the Laplacian with free edges, from the mode `first` on in each direction."""
    down, across = (2 - 2 * np.cos(np.pi * np.arange(first, n + first) / n) for n in shape)
    eigenvalues: Float[np.ndarray, "h w"] = down[:, None] + across
    return eigenvalues
