"""Noise is found where there is some, and new points are displaced onto the surface then; details stay."""

import numpy as np
import pytest

from pcsr.upsample.gaps import spacing
from pcsr.upsample.noise import Quadrics


def hill(count, noise=0.0, seed=0):
    """A flat hill whose points are about 1 apart."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-1, 1, (count, 2)) * np.sqrt(count) / 2
    height = 0.01 * (xy**2).sum(1)
    return np.column_stack([xy, height + rng.normal(0, noise, count)])


def height_over(points):
    """The height over the hill."""
    return points[:, 2] - 0.01 * (points[:, :2] ** 2).sum(1)


def fitted(cloud):
    return Quadrics.fit(cloud, spacing(cloud))


def test_a_quadric_has_the_coefficients_of_a_slow_fit():
    cloud = hill(60, 0.1)
    unit = spacing(cloud)
    quadrics = Quadrics.fit(cloud, unit)
    for i in (0, 7, 31):
        index = np.argsort(np.linalg.norm(cloud - cloud[i], axis=1))[:16]
        h, u, v = ((cloud[index] - cloud[i]) / unit[i] @ quadrics.axes[i]).T
        terms = np.column_stack([np.ones(16), u, v, u * u, u * v, v * v])
        expected, rest, *_ = np.linalg.lstsq(terms, h)
        np.testing.assert_allclose(quadrics.coefficients[i], expected, atol=1e-3)
        assert quadrics.residual[i] == pytest.approx(np.sqrt(rest[0] / 10), rel=1e-3)


@pytest.mark.parametrize("noise", [0.2, 0.3])
def test_noise_is_found_and_new_points_come_to_the_surface(noise):
    cloud = hill(800, noise)
    inner = hill(800, noise, seed=1)
    inner = inner[(np.abs(inner[:, :2]) < 11).all(1)]
    moved = fitted(cloud).displaced(inner)
    assert fitted(cloud).noisy() > 0.5
    assert np.abs(height_over(moved)).mean() < 0.6 * np.abs(height_over(inner)).mean()


def test_without_noise_nothing_moves():
    new = hill(200, seed=1)
    assert fitted(hill(800)).displaced(new) is new


def test_two_sheets_edges_and_wires_are_no_noise():
    rng = np.random.default_rng(0)
    plate = np.concatenate([rng.uniform(0, 20, (400, 3)) * [1, 1, 0] + [0, 0, z] for z in (0.0, 1.0)])
    box = rng.uniform(-4, 4, (500, 3))
    box[np.arange(500), rng.integers(0, 3, 500)] = rng.choice([-4, 4], 500)
    along = rng.uniform(0, 200, 300)
    wire = np.column_stack([along, *(0.4 * np.array([np.cos(along * 7), np.sin(along * 7)]))])
    for cloud in (plate, box, wire):
        assert fitted(cloud).noisy() == 0


def test_points_on_a_line_can_be_fitted():
    line = np.outer(np.linspace(0, 1, 40), [1.0, 2, 3])
    assert np.isfinite(fitted(line).coefficients).all()


def test_no_quadric_leaves_more_than_its_plane():
    """Quadrics are thus fitted only where planes leave residuals."""
    for noise in (0, 0.1, 0.4):
        quadrics = fitted(hill(300, noise))
        planes = np.sqrt(np.maximum(quadrics.variances[:, 0], 0) / 10)
        assert (quadrics.residual <= planes + 1e-5).all()
    flat = fitted(hill(300))
    assert flat.noisy() == 0
    assert "coefficients" not in vars(flat)
