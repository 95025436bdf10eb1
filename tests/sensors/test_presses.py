"""The region that a ball changed, and the choice of presses that are spread over the gel."""

import numpy as np
import pytest

from pcsr import UserError
from pcsr.sensors import PressImage
from pcsr.sensors.presses import CUT_OFF, STRIDE, WIDE, cut_off, press_of, spread
from tests.sensors.synthetic import BALL, PITCH, SIZE, background, ball, photo


def press(indentation, seed=0):
    return press_of(PressImage("a", photo(indentation, seed), BALL), background(), PITCH)


@pytest.mark.parametrize("centre", [(80.0, 60.0), (35.5, 40.0), (120.0, 85.0)])
@pytest.mark.parametrize("depth", [0.5, 0.9])
def test_the_changed_region_is_that_of_the_ball(centre, depth):
    found = press(ball(depth, centre))
    assert np.abs(found.centre - centre).max() < 4
    rim = np.sqrt(3**2 - (3 - 0.6 * depth) ** 2) / PITCH
    assert rim < found.radius < 2.2 * rim
    assert found.ball == BALL / 2 / PITCH
    assert found.diameter == BALL


def test_pixels_are_a_square_around_the_ball_within_the_image():
    found = press(ball(0.8, (30.0, 40.0)))
    assert len(found.rows) == len(found.columns) == len(found.monomials)
    assert found.columns.min() >= 0
    assert found.rows.max() < SIZE[0]
    assert np.unique(np.diff(np.unique(found.columns))).tolist() == [STRIDE]
    assert found.columns.max() <= found.centre[0] + WIDE * found.radius + 1
    assert len(np.unique(np.stack([found.rows, found.columns]), axis=1).T) == len(found.rows)


def test_what_shows_no_whole_ball_is_refused():
    with pytest.raises(UserError, match=r"no ball: the colour changes by \d % at most, and a contact by more than 8 %"):
        press(np.zeros(SIZE), 5)
    with pytest.raises(UserError, match=r"no ball: the changed region has a radius of [\d.]+ pixels, less than 6"):
        press_of(PressImage("a", photo(ball(0.2, diameter=1.0)), 1.0), background(), PITCH)
    with pytest.raises(UserError, match=CUT_OFF):
        press(ball(0.8, (2.0, 60.0)))


@pytest.mark.parametrize(
    ("diameter", "pitch"),
    [(BALL / 10, PITCH), (BALL * 10, PITCH), (BALL, PITCH * 1e9), (BALL, 1 / PITCH), (BALL, 1e-12)],
)
def test_a_ball_of_another_order_of_size_than_the_region_is_refused(diameter, pitch):
    with pytest.raises(UserError, match=r"times that of a ball of .* mm: check the ball's diameter and mm_per_pixel"):
        press_of(PressImage("a", photo(ball()), diameter), background(), pitch)


def test_a_contact_is_cut_off_where_its_circle_leaves_the_image():
    found = press(ball())
    assert not cut_off(found, np.array([20.0, 60.0]), 20.0)
    for centre in ((19.0, 60.0), (80.0, 15.0), (141.0, 60.0), (80.0, 100.0)):
        assert cut_off(found, np.array(centre), 20.0)


def test_presses_are_spread_from_the_middle_each_the_farthest_from_those_before():
    centres = np.random.default_rng(0).uniform(0, 100, (30, 2))
    chosen = spread(centres, 9)
    assert chosen[0] == np.argmin(np.linalg.norm(centres - centres.mean(0), axis=1))
    for number in range(1, 9):
        nearest = [min(np.linalg.norm(one - centres[k]) for k in chosen[:number]) for one in centres]
        assert chosen[number] == np.argmax(nearest)


def test_all_presses_are_chosen_once_even_where_some_lie_at_one_place():
    centres = np.zeros((6, 2))
    centres[4:] = 5.0
    assert sorted(spread(centres, 6)) == sorted(spread(centres, 60)) == list(range(6))
    assert len(set(spread(centres, 3))) == 3


def test_the_choice_does_not_depend_on_the_order():
    centres = np.random.default_rng(1).uniform(0, 100, (20, 2))
    order = np.random.default_rng(2).permutation(20)
    np.testing.assert_array_equal(centres[order][spread(centres[order], 20)], centres[spread(centres, 20)])
