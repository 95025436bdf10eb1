"""The likelihood agrees with loops over motions and points."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import gammaln

from pcsr.registration.likelihood import DENSITY, FINGER, IN_FINGER, Likelihood
from pcsr.registration.motions import matrix
from pcsr.registration.surface import TouchedSurface, View
from tests.registration.patches import plate, wavy

RNG = np.random.default_rng(0)
MOTIONS = RNG.normal(size=(4, 6)) * [0.05, 0.05, 0.05, 0.6, 0.6, 0.6]
DEVIATIONS = np.array([0.02, 0.1, 0.5, 1.0])
POINTS = RNG.uniform(-7, 7, (40, 3)) * [1, 1, 0.4]


def touched(at=(0.0, 0.0), surface=wavy, **options):
    points = surface(np.array(at) + np.random.default_rng(1).uniform(-3, 3, (300, 2)))
    return TouchedSurface.of(points, np.eye(3), 4.0, **{"oriented": True, **options})


SURFACES = {
    "one": [touched()],
    "unknown orientation": [touched(oriented=False)],
    "view": [touched(view=View(np.array([0, 0, -1.0]), (10.0, 8.0)))],
    "two fingers": [touched((-3.5, 0)), touched((3.5, 0))],
}
EACH = pytest.mark.parametrize("surfaces", SURFACES.values(), ids=SURFACES)


def local(surface, point, motion):
    """Coordinates of a point along the axes of a surface that is moved."""
    pose = matrix(motion)
    return surface.axes.T @ (pose[:3, :3].T @ (point - pose[:3, 3]) - surface.origin)


def nearby(motion, step=1e-6):
    """Six motions: small rotations about the three axes and small translations along them, after the first one."""
    turned = [Rotation.from_rotvec(step * axis) * Rotation.from_rotvec(motion[:3]) for axis in np.eye(3)]
    return [np.r_[each.as_rotvec(), motion[3:]] for each in turned] + list(motion + step * np.eye(6)[3:])


def slow(surface, point, motion, deviation, spacing):
    """Terms of one point and one surface, with the derivative of the distance."""
    x, y, z = local(surface, point, motion)
    planes = surface.planes(*(np.array([each]) for each in (x, y, z)))
    normal = np.array([-planes.slope_x[0], -planes.slope_y[0], 1])
    offset = planes.height[0] - normal @ [x, y, z]
    normal, offset = normal / np.linalg.norm(normal), offset / np.linalg.norm(normal)

    def distance(motion):
        return normal @ local(surface, point, motion) + offset

    contact = planes.level[0] == -np.inf
    variance = deviation**2 + planes.widening[0]
    on = 0.0
    if np.isfinite(variance):
        on = spacing / np.sqrt(2 * np.pi * variance) * np.exp(-(distance(motion) ** 2) / (2 * variance))
    above = distance(motion) if contact else z - planes.level[0]
    filled = surface.oriented and (0 if contact else deviation) < above < FINGER
    background = IN_FINGER if filled else 1.0
    jacobian = np.array([distance(each) - distance(motion) for each in nearby(motion)]) / 1e-6
    share = on / (on + background)
    return share, min(1.0, on + background), contact, distance(motion), share / variance, jacobian


@EACH
def test_terms_are_those_of_each_point(surfaces):
    likelihood = Likelihood(surfaces, POINTS, 1.3)
    terms = likelihood.terms(MOTIONS, DEVIATIONS)
    for number, (motion, deviation) in enumerate(zip(MOTIONS, DEVIATIONS, strict=True)):
        information, gradient = np.zeros((6, 6)), np.zeros(6)
        for index, point in enumerate(POINTS):
            parts = [slow(surface, point, motion, deviation, 1.3) for surface in surfaces]
            share, _, contact, distance, weight, jacobian = max(parts, key=lambda part: part[0])
            assert terms.share[number, index] == pytest.approx(share, abs=1e-12)
            assert terms.inside[number, index] == pytest.approx(share * contact, abs=1e-12)
            assert terms.against[number, index] == pytest.approx(sum(np.log(part[1]) for part in parts), abs=1e-9)
            if share:
                assert terms.squared[number, index] == pytest.approx(distance**2, abs=1e-9)
            information += weight * np.outer(jacobian, jacobian)
            gradient += weight * distance * jacobian
        scale = abs(information).max()
        np.testing.assert_allclose(terms.information[number] / scale, information / scale, atol=1e-4)
        scale = abs(gradient).max()
        np.testing.assert_allclose(terms.gradient[number] / scale, gradient / scale, atol=1e-4)


@EACH
def test_the_logarithm_counts_points_in_the_finger_and_those_that_are_missing(surfaces):
    likelihood = Likelihood(surfaces, POINTS, 1.3)
    terms = likelihood.terms(MOTIONS, DEVIATIONS)
    expected = DENSITY / 1.3**2 * sum(surface.area for surface in surfaces)
    assert likelihood.expected == pytest.approx(expected)
    for log, inside, against in zip(likelihood.log(terms), terms.inside, terms.against, strict=True):
        found = min(inside.sum(), expected)
        assert log == pytest.approx(against.sum() + found * np.log(expected) - gammaln(found + 1))


def test_what_the_finger_filled_is_empty():
    xy = np.random.default_rng(2).uniform(-2, 2, (20, 2))
    likelihood = Likelihood([touched(surface=plate)], plate(xy), 1.3)
    motions = np.array([[0, 0, 0, 0, 0, height] for height in (-0.7, 0, 0.7)])
    log = likelihood.log(likelihood.terms(motions, np.full(3, 0.1)))
    assert log[1] > log[2] > log[0]  # a touch below the points has them where the finger was


def test_the_surface_is_less_certain_beyond_the_contact():
    likelihood = Likelihood([touched(surface=plate)], np.array([[0, 0, -0.2], [5.0, 0, -0.2]]), 1.3)
    share = likelihood.terms(np.zeros((1, 6)), np.array([0.05])).share[0]
    assert share[0] < 0.01 < share[1]


def test_without_a_surface_nothing_is_known():
    terms = Likelihood([], POINTS, 1.3).terms(MOTIONS, DEVIATIONS)
    assert not terms.share.any()
    assert not terms.against.any()
    assert not terms.information.any()
