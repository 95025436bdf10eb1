"""Shared motions settle what single touches cannot: on which of many equal teeth they are."""

import numpy as np
import pytest

from pcsr.registration.arm import Arm, Evidence
from pcsr.registration.consensus import arm_of
from pcsr.registration.fit import Prior, fit
from pcsr.registration.likelihood import Likelihood
from pcsr.registration.motions import isotropic
from pcsr.registration.surface import TouchedSurface

STATED = isotropic(1.2, 0.01)
FLOOR = 0.02


def teeth(period):
    def surface(xy):
        phase = 2 * np.pi * xy[:, 0] / period
        return np.column_stack([xy, 0.4 * np.sin(phase) + 0.3 * np.cos(0.8 * xy[:, 1])])

    return surface


def touching(surface, slide, seed):
    rng = np.random.default_rng(seed)
    touched = TouchedSurface.of(surface(rng.uniform(-5, 5, (2000, 2))), np.eye(3), 5.0, oriented=True)
    return Likelihood([touched], surface(rng.uniform(-10, 10, (400, 2))) + np.array([slide, 0, 0]), 1.0)


def arm(likelihoods):
    first = [fit(one, Prior(np.zeros(6), STATED), FLOOR) for one in likelihoods]
    frames = [np.eye(6)] * len(first)
    return first, frames, arm_of(first, likelihoods, frames, STATED, [FLOOR] * len(first), FLOOR)


def test_a_touch_on_the_wrong_tooth_is_corrected_by_the_others():
    likelihoods = [touching(teeth(period), 1.6, seed) for seed, period in enumerate((2.8, 3.4, 4.4))]
    first, frames, _ = arm(likelihoods)
    tooth = Prior(np.array([0, 0, 0, 1.6 - 2.8, 0, 0]), isotropic(0.1, 0.01))
    wrong = [fit(likelihoods[0], tooth, FLOOR), *first[1:]]
    assert wrong[0].motion[3] == pytest.approx(-1.2, abs=0.1)
    alone = Arm.of([Evidence(one.mode, frame) for one, frame in zip(wrong, frames, strict=True)], STATED)
    found = arm_of(wrong, likelihoods, frames, STATED, [FLOOR] * 3, FLOOR)
    assert abs(alone.offset().mean[3] - 1.6) > 0.3
    assert found.offset().mean[3] == pytest.approx(1.6, abs=0.15)
    assert found.private < 0.3 < alone.private


def test_it_explains_the_cloud_at_least_as_well_as_the_touches_alone():
    likelihoods = [touching(teeth(period), 1.6, seed) for seed, period in enumerate((2.8, 3.4))]
    first, frames, found = arm(likelihoods)
    alone = Arm.of([Evidence(one.mode, frame) for one, frame in zip(first, frames, strict=True)], STATED)
    assert found.log >= alone.log


def test_without_touches_there_is_no_evidence():
    found = arm_of([], [], [], STATED, [], FLOOR)
    np.testing.assert_array_equal(found.offset().mean, np.zeros(6))
