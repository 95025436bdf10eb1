import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pcsr_plugins.touch.digit.noise import Noise, blurred, smooth_field

PITCH = 0.2
SHAPE = (50, 60)
CURVED = np.add.outer(np.linspace(0, 1, 50) ** 2, np.linspace(0, 0.7, 60) ** 2)


def disc(radius=20.0):
    rows, columns = np.indices(SHAPE)
    return np.hypot(rows - 25, columns - 30) < radius


def measure(seed=0, heights=CURVED, contact=None, **terms):
    mask = disc() if contact is None else contact
    return Noise(**{"depth_noise": 0.0, **terms}).heights(heights, mask, PITCH, np.random.default_rng(seed))


def test_no_noise_is_no_change():
    outside = np.where(disc(), CURVED, -np.inf)
    assert np.array_equal(measure(heights=outside), outside)
    assert np.array_equal(Noise().pose_error(np.random.default_rng(0)), np.eye(4))
    assert np.array_equal(Noise().shared_error(np.random.default_rng(0)), np.eye(4))
    assert not Noise(position_noise=1.0, rotation_noise=1.0).shared


@pytest.mark.parametrize(
    "term", [{"blur": 0.3}, {"drift": 0.1}, {"depth_noise": 0.05}, {"quantum": 0.03}], ids=lambda term: next(iter(term))
)
def test_a_term_changes_the_contact_alone_and_the_same_seed_gives_the_same(term):
    outside = np.where(disc(), CURVED, -np.inf)
    rough = measure(heights=outside, **term)
    assert np.isfinite(rough[disc()]).all()
    assert np.isneginf(rough[~disc()]).all()
    assert (rough != outside)[disc()].mean() > 0.9
    assert np.array_equal(rough, measure(heights=outside, **term))


def test_terms_are_drawn_whatever_the_others_are():
    drift, white = measure(drift=0.1) - CURVED, measure(depth_noise=0.05) - CURVED
    both = measure(drift=0.1, depth_noise=0.05) - CURVED
    np.testing.assert_allclose(both, drift + white, atol=1e-12)
    double = measure(drift=0.1, depth_noise=0.1) - CURVED
    np.testing.assert_allclose(double, drift + 2 * white, atol=1e-12)
    in_part = measure(contact=disc(8.0), depth_noise=0.05) - CURVED
    np.testing.assert_allclose(in_part[disc(8.0)], white[disc(8.0)], atol=1e-12)


def test_the_order_is_blur_drift_white_steps():
    everything = {"blur": 0.3, "drift": 0.1, "depth_noise": 0.05, "quantum": 0.03}
    smooth = measure(blur=0.3)
    random = measure(drift=0.1, depth_noise=0.05) - CURVED
    expected = np.where(disc(), np.round((smooth + random) / 0.03) * 0.03, CURVED)
    np.testing.assert_allclose(measure(**everything), expected, atol=1e-9)


def test_white_noise_has_its_deviation_and_no_neighbours():
    rough = measure(contact=np.ones(SHAPE, bool), depth_noise=0.05) - CURVED
    assert rough.std() == pytest.approx(0.05, rel=0.05)
    assert abs(np.corrcoef(rough[:, 1:].ravel(), rough[:, :-1].ravel())[0, 1]) < 0.05


@settings(deadline=None, max_examples=30)
@given(st.floats(1e-3, 0.5), st.integers(0, 100))
def test_steps_are_whole_and_never_off_by_more_than_half(quantum, seed):
    heights = np.random.default_rng(seed).uniform(0, 2, SHAPE)
    stepped = measure(heights=heights, quantum=quantum)[disc()] / quantum
    np.testing.assert_allclose(stepped, np.round(stepped), atol=1e-6)
    assert np.abs(stepped - heights[disc()] / quantum).max() <= 0.5 + 1e-9


def slow_blur(heights, contact, sigma):
    """A mean over the contact's pixels, each weighed by a Gaussian of its distance, one pixel at a time."""
    at, values = np.argwhere(contact), heights[contact]
    result = heights.copy()
    for row, column in at:
        weight = np.exp(-((at - [row, column]) ** 2).sum(1) / (2 * sigma**2))
        result[row, column] = (weight * values).sum() / weight.sum()
    return result


def test_blur_is_a_weighted_mean_over_the_contact_alone():
    heights = np.random.default_rng(0).normal(size=SHAPE)
    heights[~disc()] = -np.inf
    np.testing.assert_allclose(
        blurred(heights, disc(), 1.5)[disc()], slow_blur(heights, disc(), 1.5)[disc()], atol=0.01
    )
    # A flat contact stays flat up to its edge.
    np.testing.assert_allclose(measure(heights=np.where(disc(), 0.7, 9.0), blur=0.5)[disc()], 0.7)


@pytest.mark.parametrize("length", [1.0, 4.0])
def test_a_drift_field_has_deviation_one_and_its_correlation_length(length):
    apart = np.array([0.0, 0.5, 1.0, 2.0])
    candidates = np.column_stack([apart * length, np.zeros(4)])
    fields = np.array([smooth_field(candidates, length, np.random.default_rng(seed)) for seed in range(4000)])
    assert fields.mean() == pytest.approx(0, abs=0.05)
    assert fields.std(0) == pytest.approx(np.ones(4), rel=0.05)
    correlation = [np.corrcoef(fields[:, 0], fields[:, k])[0, 1] for k in range(4)]
    np.testing.assert_allclose(correlation, np.exp(-(apart**2) / 2), atol=0.05)


def test_the_drift_does_not_depend_on_the_pixels():
    coarse = Noise(drift=1.0, depth_noise=0.0).heights(
        np.zeros((9, 9)), np.ones((9, 9), bool), 0.6, np.random.default_rng(1)
    )
    fine = Noise(drift=1.0, depth_noise=0.0).heights(
        np.zeros((27, 27)), np.ones((27, 27), bool), 0.2, np.random.default_rng(1)
    )
    np.testing.assert_allclose(fine[1::3, 1::3], coarse, atol=1e-12)


def test_pose_errors_have_their_deviations_and_leave_each_other_alone():
    def errors(**terms):
        return np.array([Noise(**terms).pose_error(np.random.default_rng(seed)) for seed in range(1000)])

    both, turned, moved = (
        errors(position_noise=0.5, rotation_noise=2.0),
        errors(rotation_noise=2.0),
        errors(position_noise=0.5),
    )
    np.testing.assert_array_equal(both[:, :3, :3], turned[:, :3, :3])
    np.testing.assert_array_equal(both[:, :3, 3], moved[:, :3, 3])
    np.testing.assert_allclose(moved[:, :3, 3].std(0), 0.5, rtol=0.1)
    angles = Rotation.from_matrix(turned[:, :3, :3]).as_rotvec(degrees=True)
    np.testing.assert_allclose(angles.std(0), 2.0, rtol=0.1)
