import numpy as np
import pytest

from pcsr.exploration.contact import ContactModel
from tests.exploration.scenes import TIP, ball, plane

FRAME = np.eye(3)


def test_a_plane_is_touched_by_the_whole_gel():
    contact = ContactModel.of(plane()).press(np.zeros(3), FRAME, 1.0, TIP)
    assert contact.area == pytest.approx(16 * 12, rel=0.12)
    assert contact.top == pytest.approx(0, abs=1e-9)
    np.testing.assert_allclose(contact.points[:, 2], 0, atol=1e-9)
    assert (np.abs(contact.points[:, :2]) <= [8, 6]).all()


def test_the_contact_of_a_ball_grows_with_the_press():
    model = ContactModel.of(ball(4000))
    areas = [model.press(np.array([0, 0, 15.0]), FRAME, press, TIP).area for press in (0.5, 1.0, 1.5)]
    assert areas == sorted(areas)
    # A cap of height 0.6 has an area of 2 π · 15 · 0.6 mm²; heights between points are uncertain.
    assert areas[1] == pytest.approx(56.5, rel=0.4)


def test_half_a_plane_is_touched_by_half_the_gel():
    points = plane(3000)
    contact = ContactModel.of(points[points[:, 0] < 0]).press(np.zeros(3), FRAME, 1.0, TIP)
    assert contact.area == pytest.approx(8 * 12, rel=0.2)
    assert contact.points[:, 0].max() < 2


def test_the_finger_stops_at_what_is_above():
    points = np.concatenate([plane(), plane(200, side=4.0) + np.array([0, 0, 10])])
    contact = ContactModel.of(points).press(np.zeros(3), FRAME, 1.0, TIP)
    assert contact.top == pytest.approx(10)
    assert contact.area < 40


def test_it_turns_with_the_frame():
    turn = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    points = ball(800)
    at = np.array([0, 0, 15.0])
    plain = ContactModel.of(points).press(at, FRAME, 1.0, TIP)
    turned = ContactModel.of(points @ turn.T).press(turn @ at, turn @ FRAME, 1.0, TIP)
    assert turned.area == pytest.approx(plain.area, rel=1e-6)
    np.testing.assert_allclose(turned.points, plain.points @ turn.T, atol=1e-6)


def test_beside_the_object_nothing_is_touched():
    assert ContactModel.of(plane()).press(np.array([500.0, 0, 0]), FRAME, 1.0, TIP) is None
