"""Expected errors of touched points agree with a loop over points and particles."""

from dataclasses import replace

import numpy as np
import pytest

from pcsr.registration.fit import Prior, fit
from pcsr.registration.likelihood import Likelihood
from pcsr.registration.motions import isotropic, matrix
from pcsr.registration.point_errors import MOST_POINTS, point_errors
from pcsr.registration.surface import TouchedSurface
from tests.registration.patches import plate, wavy

PRIOR = Prior(np.zeros(6), isotropic(0.7, 0.02))


def case(surface, count=200, half=7.0):
    rng = np.random.default_rng(0)
    points = surface(rng.uniform(-4, 4, (count, 2)))
    touched = TouchedSurface.of(points, np.eye(3), 4.0, oriented=True)
    likelihood = Likelihood([touched], surface(rng.uniform(-half, half, (90, 2))), 1.4)
    return likelihood, fit(likelihood, PRIOR, 0.05), points


@pytest.mark.parametrize("surface", [plate, wavy])
def test_they_are_those_of_each_point(surface):
    likelihood, after, points = case(surface)
    (touched,) = likelihood.surfaces
    share = likelihood.terms(after.motion[None], np.array([after.deviation])).share[0]
    likely = after.weights > 1e-3 * after.weights.max()
    found = point_errors(likelihood, after, points)
    for error, point in zip(found[::20], points[::20], strict=True):
        here = (matrix(after.motion) @ np.append(point, 1))[:3]
        seen = min(np.linalg.norm(here - each) for each in likelihood.points[share > 0.5])
        total = 0.0
        for motion, weight in zip(after.particles[likely], after.weights[likely], strict=True):
            back = np.linalg.solve(matrix(motion), np.append(here, 1))[:3]
            distance, outside = touched.find(back[None])
            total += weight * min(seen, np.hypot(distance, outside)[0], np.linalg.norm(back - point)) ** 2
        expected = np.sqrt(total / after.weights[likely].sum() + touched.noise**2)
        assert error == pytest.approx(expected, rel=1e-9)


def test_sliding_along_a_plate_does_harm_at_its_border_only():
    likelihood, after, points = case(plate, count=600)
    errors = point_errors(likelihood, after, points)
    border = abs(points[:, :2]).max(1)
    assert np.median(errors[border > 3.8]) > 3 * np.median(errors[border < 2.5])


def test_errors_are_finite_wherever_the_particles_are():
    likelihood, after, points = case(wavy)
    far = replace(after, particles=after.particles + np.array([0, 0, 0, 20.0, 0, 0]))
    assert np.isfinite(point_errors(likelihood, far, points)).all()


def test_without_a_surface_they_are_those_of_the_motion():
    _, after, points = case(plate)
    errors = point_errors(Likelihood([], np.zeros((0, 3)), 1.0), after, points)
    spread = np.sqrt(after.weights @ ((after.particles - after.motion)[:, 3:] ** 2).sum(1))
    assert np.median(errors) == pytest.approx(spread, rel=0.3)


def test_of_very_many_points_the_nearest_are_computed():
    likelihood, after, _ = case(wavy)
    points = wavy(np.random.default_rng(3).uniform(-4, 4, (3 * MOST_POINTS, 2)))
    errors = point_errors(likelihood, after, points)
    one_by_one = np.concatenate([point_errors(likelihood, after, part) for part in np.array_split(points, 3)])
    assert len(errors) == len(points)
    assert np.corrcoef(errors, one_by_one)[0, 1] > 0.9
