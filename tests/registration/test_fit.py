"""Distributions of motions: the prior along what the cloud doesn't constrain, narrow along what it does."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from pcsr.registration.fit import Prior, fit, modes
from pcsr.registration.likelihood import Likelihood
from pcsr.registration.motions import isotropic, matrix
from pcsr.registration.surface import TouchedSurface
from tests.registration.patches import plate, scan, wavy

PRIOR = Prior(np.zeros(6), isotropic(0.7, 0.02))
MOTION = np.array([0.01, -0.02, 0.01, 0.5, -0.4, 0.6])


def likelihood(surface, motion=MOTION, seed=0):
    """A touch whose motion is wrong by the inverse of `motion`."""
    points = surface(np.random.default_rng(seed).uniform(-5, 5, (600, 2)))
    touched = TouchedSurface.of(points, np.eye(3), 4.0, oriented=True)
    cloud = scan(surface, seed=seed + 1, half=9, count=300)
    pose = matrix(motion)
    return Likelihood([touched], cloud @ pose[:3, :3].T + pose[:3, 3], 1.0)


def test_the_density_of_the_prior_is_that_of_the_normal_distribution():
    root = np.random.default_rng(0).normal(size=(6, 6))
    prior = Prior(np.arange(6.0), root @ root.T)
    motions = np.random.default_rng(1).normal(size=(5, 6))
    dense = multivariate_normal(prior.mean, prior.covariance)
    np.testing.assert_allclose(prior.log(motions) - 3 * np.log(2 * np.pi), dense.logpdf(motions))


@pytest.mark.parametrize("seed", range(2))
def test_a_curved_surface_fixes_the_motion(seed):
    found = fit(likelihood(wavy, seed=seed), PRIOR, 0.02)
    away = matrix(found.motion) @ np.linalg.inv(matrix(MOTION))
    assert np.linalg.norm(away[:3, 3]) < 0.1
    assert (np.sqrt(np.diag(found.covariance))[3:] < 0.2).all()
    assert found.weights.sum() == pytest.approx(1)
    assert found.deviation < 0.1


def test_of_a_plate_only_the_constrained_directions_move():
    mean = np.array([0, 0, 0.01, 0.3, -0.2, 0])
    found = fit(likelihood(plate, np.array([0.01, -0.02, 0, 0, 0, 0.6])), Prior(mean, PRIOR.covariance), 0.02)
    np.testing.assert_allclose(found.motion[[0, 1, 5]], [0.01, -0.02, 0.6], atol=0.02)
    np.testing.assert_allclose(found.motion[[3, 4]], mean[[3, 4]], atol=0.15)
    deviations = np.sqrt(np.diag(found.covariance))
    np.testing.assert_allclose(deviations[[2, 3, 4]], [0.02, 0.7, 0.7], rtol=0.5)
    assert (deviations[[0, 1, 5]] < [0.005, 0.005, 0.05]).all()


def test_without_a_cloud_the_prior_stays():
    mean = MOTION
    found = fit(Likelihood(likelihood(wavy).surfaces, np.zeros((0, 3)), 1.0), Prior(mean, PRIOR.covariance), 0.02)
    np.testing.assert_array_equal(found.motion, mean)
    np.testing.assert_allclose(np.diag(found.covariance), np.diag(PRIOR.covariance), rtol=0.6)
    np.testing.assert_allclose(found.weights @ found.particles, mean, atol=1e-12)
    assert not found.mode.information.any()
    assert found.freedom == 0


def test_a_mode_is_the_maximum_that_its_information_describes():
    """The gradient of likelihood and prior vanishes, and the vector is that of the motion without the prior."""
    one = likelihood(wavy)
    precision = np.linalg.inv(PRIOR.covariance)
    starts = np.zeros((2, 6))
    motions, found = modes(one, starts, precision, 0.02, 0.05, 0.3, (3, 12))
    for motion, mode in zip(motions, found, strict=True):
        np.testing.assert_allclose(mode.information, mode.information.T, rtol=1e-9)
        after = np.linalg.solve(mode.information + precision, mode.vector + precision @ starts[0])
        np.testing.assert_allclose(after, motion, atol=1e-9)
        terms = one.terms(motion[None], np.array([0.05]))
        np.testing.assert_allclose(mode.information, terms.information[0])
        step = np.linalg.solve(terms.information[0] + precision, terms.gradient[0] + precision @ motion)
        np.testing.assert_allclose(step, np.zeros(6), atol=1e-3)


def test_the_deviation_of_a_noisy_cloud_is_found():
    one = likelihood(wavy, np.zeros(6))
    noisy = one.points + np.random.default_rng(5).normal(size=one.points.shape) * 0.15
    found = fit(Likelihood(one.surfaces, noisy, 1.0), PRIOR, 0.02)
    assert found.deviation == pytest.approx(0.15, rel=0.3)
    assert fit(Likelihood(one.surfaces, noisy, 1.0), PRIOR, 0.02, 0.2).deviation == 0.2
