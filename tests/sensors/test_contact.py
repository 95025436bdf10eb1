import numpy as np
import pytest

from pcsr.sensors.contact import in_contact


def cap(radius=40.0, press=6.0, middle=(60, 80)):
    """The indentation by a ball, in pixels, of a gel that takes its shape."""
    v, u = np.mgrid[:120, :160]
    apart = (v - middle[0]) ** 2 + (u - middle[1]) ** 2
    return np.sqrt(np.maximum(radius**2 - apart, 0)) - (radius - press)


@pytest.mark.parametrize("share", [0.2, 0.4, 0.6])
def test_a_ball_is_in_contact_in_a_disc(share):
    found = in_contact(cap(), share)
    expected = np.pi * (40**2 - (40 - (1 - share) * 6) ** 2)
    assert found.sum() == pytest.approx(expected, rel=0.02)


def test_only_what_is_connected_with_the_deepest_pixel_is_in_contact():
    both = np.maximum(cap(middle=(30, 30), press=5.0), cap(middle=(80, 120)))
    np.testing.assert_array_equal(in_contact(both), in_contact(cap(middle=(80, 120))))


def test_nothing_is_in_contact_with_a_gel_at_rest():
    rest = np.random.default_rng(0).normal(0, 0.01, (60, 80))
    assert not in_contact(rest, at_least=0.05).any()
    assert not in_contact(np.zeros((5, 5))).any()


def test_pixels_that_are_not_finite_are_not_in_contact():
    deep = cap()
    deep[60, 80], deep[0, 0] = np.nan, np.inf
    assert not in_contact(deep)[60, 80]
    assert not in_contact(np.full((4, 4), np.nan)).any()
