"""Quadrics beside slow fits, and what is left out of them."""

import numpy as np
import pytest

from pcsr.upsample.local_fits import LocalFits


def neighbourhoods(count=6, size=20, noise=0.1, seed=0):
    rng = np.random.default_rng(seed)
    u, v = rng.uniform(-3, 3, (2, count, size))
    height = 0.1 * u * u - 0.05 * u * v + 0.02 * v + noise * rng.normal(size=u.shape)
    return np.stack([u, v, height], axis=-1)


def slow(points):
    """Distances of the points from the quadric over their best plane, and the leverages."""
    axes = np.linalg.eigh(np.cov(points.T))[1]
    h, u, v = (points @ axes).T
    terms = np.column_stack([np.ones_like(u), u, v, u * u, u * v, v * v])
    coefficients = np.linalg.lstsq(terms, h)[0]
    du = coefficients[1] + 2 * coefficients[3] * u + coefficients[4] * v
    dv = coefficients[2] + coefficients[4] * u + 2 * coefficients[5] * v
    leverage = np.diag(terms @ np.linalg.pinv(terms))
    return (h - terms @ coefficients) / np.sqrt(1 + du**2 + dv**2), leverage


def test_residuals_and_leverages_are_those_of_a_slow_fit():
    clouds = neighbourhoods()
    fits = LocalFits.of(clouds)
    for number, points in enumerate(clouds):
        residual, leverage = slow(points)
        np.testing.assert_allclose(np.abs(fits.residual[number]), np.abs(residual), atol=1e-5)
        np.testing.assert_allclose(fits.leverage[number], leverage, atol=1e-5)


def test_normals_have_length_1_and_lead_to_the_surface():
    clouds = neighbourhoods(noise=0.0)
    clouds[:, 0] += [0, 0, 0.4]
    fits = LocalFits.of(clouds, level=0.05)
    np.testing.assert_allclose(np.linalg.norm(fits.normal, axis=-1), 1)
    moved = clouds[:, 0] - fits.residual[:, :1] * fits.normal[:, 0]
    u, v, height = moved.T
    np.testing.assert_allclose(height, 0.1 * u * u - 0.05 * u * v + 0.02 * v, atol=0.05)


def test_neighbours_that_are_not_chosen_have_no_influence():
    clouds = neighbourhoods()
    chosen = np.ones(clouds.shape[:2], bool)
    chosen[:, -5:] = False
    fits = LocalFits.of(clouds, chosen)
    for number, points in enumerate(clouds):
        np.testing.assert_allclose(np.abs(fits.residual[number, :-5]), np.abs(slow(points[:-5])[0]), atol=1e-5)
    assert not fits.fitted[:, -5:].any()


def test_outliers_are_left_out():
    clouds = neighbourhoods(noise=0.02)
    clouds[:, 3, 2] += 1.0
    fits = LocalFits.of(clouds, level=0.02)
    assert not fits.fitted[:, 3].any()
    assert fits.fitted.mean() > 0.8


@pytest.mark.parametrize("points", [np.outer(np.linspace(-1, 1, 20), [1.0, 2, 3]), np.zeros((20, 3))])
def test_points_on_a_line_or_a_spot_can_be_fitted(points):
    fits = LocalFits.of(points[None])
    assert all(np.isfinite(one).all() for one in (fits.residual, fits.normal, fits.leverage))
