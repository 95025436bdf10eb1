"""The error of the arm agrees with dense linear algebra over all motions at once."""

import numpy as np
import pytest

from pcsr.registration import arm
from pcsr.registration.arm import DOUBT, LIKELY, STEPS, Arm, Evidence
from pcsr.registration.fit import Mode
from pcsr.registration.motions import carried, isotropic

STATED = isotropic(0.7, 0.02)


def evidence(count, seed=0, directions=6, deviation=0.05):
    """What touches say that constrain some directions each."""
    rng = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        jacobian = rng.normal(size=(directions, 6)) * [10, 10, 10, 1, 1, 1] / deviation
        information = jacobian.T @ jacobian
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        axes *= np.sign(np.linalg.det(axes))
        motion = rng.normal(size=6) * np.sqrt(np.diag(STATED))
        found.append(Evidence(Mode(information, information @ motion, -3.0), carried(axes, rng.normal(size=3) * 20)))
    return found


def joint(found, private, shared):
    """Integrate over the shared motion and those of k touches, a normal distribution of 6 k + 6 dimensions.

    Returns the logarithm of the integral, and mean and covariance of the shared motion.
    """
    count = len(found)
    prior = np.zeros((6 * count + 6, 6 * count + 6))
    prior[:6, :6] = shared**2 * STATED
    through = np.concatenate([np.eye(6), *(one.carried for one in found)])
    prior = through @ prior[:6, :6] @ through.T
    for k in range(count):
        rows = slice(6 * k + 6, 6 * k + 12)
        prior[rows, rows] += private**2 * STATED
    information, vector, most = np.zeros_like(prior), np.zeros(len(prior)), 0.0
    for k, one in enumerate(found):
        rows = slice(6 * k + 6, 6 * k + 12)
        information[rows, rows], vector[rows] = one.mode.information, one.mode.vector
        best = np.linalg.lstsq(one.mode.information, one.mode.vector, rcond=None)[0]
        most += one.mode.vector @ best
    after = np.linalg.inv(np.eye(len(prior)) + prior @ information) @ prior
    log = -0.5 * np.linalg.slogdet(np.eye(len(prior)) + prior @ information)[1] + 0.5 * (vector @ after @ vector - most)
    return log, (after @ vector)[:6], after[:6, :6]


def mixture(found):
    """Probabilities of all pairs of deviations, and mean and covariance of the shared motion for each."""
    pairs = [(private, shared) for private in STEPS for shared in (0.0, *STEPS)]
    parts = [joint(found, *pair) for pair in pairs]
    logs = np.array([part[0] for part in parts])
    logs -= 0.5 * (np.log(np.hypot(*np.array(pairs).T)) / DOUBT) ** 2
    weights = np.where(logs > logs.max() + np.log(LIKELY), np.exp(logs - logs.max()), 0)
    return weights / weights.sum(), np.array(pairs), parts


@pytest.mark.parametrize("count", [0, 1, 3])
def test_it_is_the_integral_over_all_motions(count):
    found = evidence(count)
    estimated = Arm.of(found, STATED)
    weights, pairs, parts = mixture(found)
    assert estimated.private == pytest.approx(weights @ pairs[:, 0], rel=1e-5)
    assert estimated.shared == pytest.approx(weights @ pairs[:, 1], rel=1e-5)
    offset = estimated.offset()
    mean = sum(weight * part[1] for weight, part in zip(weights, parts, strict=True))
    np.testing.assert_allclose(offset.mean, mean, atol=1e-7)
    away = np.array([part[1] for part in parts]) - mean
    covariance = sum(
        weight * (part[2] + np.outer(each, each)) for weight, part, each in zip(weights, parts, away, strict=True)
    )
    np.testing.assert_allclose(offset.covariance, covariance, atol=1e-7)


def test_a_touch_does_not_count_twice_in_its_own_prior(monkeypatch):
    """With one pair of deviations the prior of a touch is the offset that the others give, and its own motion."""
    found = evidence(3, directions=3)
    monkeypatch.setattr(arm, "STEPS", (0.5,))
    monkeypatch.setattr(arm, "LIKELY", 1e-300)
    whole, others = Arm.of(found, STATED), Arm.of([found[0], found[2]], STATED)
    shared = whole.shared_steps == 0.5
    assert shared.any()
    means, covariances = whole._offsets(1)
    expected, spread = others._offsets(None)
    np.testing.assert_allclose(means[shared], expected[others.shared_steps == 0.5], atol=1e-9)
    np.testing.assert_allclose(covariances[shared], spread[others.shared_steps == 0.5], atol=1e-12)
    prior = whole.prior(found[1].carried, 1)
    np.testing.assert_allclose(prior.mean, found[1].carried @ (whole.probabilities @ means), atol=1e-9)
    assert (np.linalg.eigvalsh(prior.covariance - 0.25 * STATED) > -1e-12).all()


@pytest.mark.parametrize(("scale", "share"), [(0.0, 0.1), (0.3, 0.6), (1.0, 1.5)])
def test_the_deviation_of_exact_and_inexact_arms_is_found(scale, share):
    rng = np.random.default_rng(3)
    found = []
    for one in evidence(12, seed=4):
        motion = scale * rng.normal(size=6) * np.sqrt(np.diag(STATED))
        found.append(Evidence(Mode(one.mode.information, one.mode.information @ motion, 0.0), one.carried))
    estimated = Arm.of(found, STATED)
    assert estimated.shared < 0.7 * max(scale, 0.1)
    assert scale / 1.6 <= estimated.private <= share


def test_a_motion_that_all_share_is_the_offset():
    shared = np.array([0.02, -0.01, 0.015, 0.6, -0.4, 0.5])
    found = []
    for one in evidence(6):
        motion = one.carried @ shared
        found.append(Evidence(Mode(one.mode.information, one.mode.information @ motion, 0.0), one.carried))
    estimated = Arm.of(found, STATED)
    np.testing.assert_allclose(estimated.offset().mean, shared, atol=0.01)
    assert estimated.private < 0.1 < estimated.shared
    for one in found:
        np.testing.assert_allclose(estimated.prior(one.carried).mean, one.carried @ shared, atol=0.3)


def test_without_evidence_the_error_is_as_stated():
    estimated = Arm.of([], STATED)
    offset, prior = estimated.offset(), estimated.prior(np.eye(6))
    np.testing.assert_array_equal(offset.mean, np.zeros(6))
    np.testing.assert_array_equal(prior.mean, np.zeros(6))
    assert 0.3 < np.sqrt(prior.covariance[5, 5] / STATED[5, 5]) < 3
