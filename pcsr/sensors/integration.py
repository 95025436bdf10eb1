"""Integration of slopes to heights by least squares."""

import numpy as np
from jaxtyping import Float
from scipy import fft


def integrated(gradients: Float[np.ndarray, "h w 2"]) -> Float[np.ndarray, "h w"]:
    """Return the surface of mean height 0 whose slopes fit `gradients` by least squares.

    The height difference of two neighbouring pixels is the mean of their slopes. The normal equations of all
    differences are a Poisson equation with free (Neumann) edges, which the cosine transform diagonalizes.

    Args:
        gradients: slopes along x (columns) and y (rows), in height per pixel.
    """
    h, w = gradients.shape[:2]
    across = (gradients[:, 1:, 0] + gradients[:, :-1, 0]) / 2
    down = (gradients[1:, :, 1] + gradients[:-1, :, 1]) / 2
    right = -np.diff(np.pad(across, ((0, 0), (1, 1))), axis=1) - np.diff(np.pad(down, ((1, 1), (0, 0))), axis=0)
    waves = 2 - 2 * np.cos(np.pi * np.arange(h) / h)[:, None] + 2 - 2 * np.cos(np.pi * np.arange(w) / w)
    waves[0, 0] = 1  # the mean, which slopes do not determine
    spectrum = fft.dctn(right, norm="ortho") / waves
    spectrum[0, 0] = 0
    surface: Float[np.ndarray, "h w"] = fft.idctn(spectrum, norm="ortho")
    return surface
