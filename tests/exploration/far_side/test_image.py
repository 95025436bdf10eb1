import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pcsr.exploration.far_side.image import HALF, PITCH, PIXELS, ViewFrame, image, pixel_centres
from tests.exploration.scenes import NOTHING, ball

UP = np.array([0.0, 0, 1])
SEEN = ball(1500)[ball(1500)[:, 2] > 0]


def drawn_slowly(seen, touched):
    """The image, pixel by pixel."""
    layers = np.zeros((4, PIXELS, PIXELS))
    away = np.linalg.norm(seen[:, None, :2] - seen[None, :, :2], axis=-1)
    spacing = np.median(np.sort(away, 1)[:, 1:4].mean(1))
    for number, centre in enumerate(pixel_centres()):
        row, column = divmod(number, PIXELS)
        distance = np.linalg.norm(seen[:, :2] - centre, axis=1)
        nearest = np.argsort(distance)[:3]
        near = nearest[distance[nearest] < max(2.2 * spacing, PITCH)]
        if len(near):
            layers[:2, row, column] = seen[near, 2].max(), 1
        inside = (np.abs(touched[:, :2] - centre) <= PITCH / 2).all(1)
        if inside.any():
            layers[2:, row, column] = touched[inside, 2].min(), 1
    return layers


def test_an_image_is_that_of_the_slow_one():
    local = ViewFrame.of(SEEN, UP).local(SEEN)
    touched = np.array([[0.3, 0.2, -1.0], [0.31, 0.21, -1.2], [0.9, -0.9, -0.5], [5.0, 0.0, 0.0]])
    np.testing.assert_allclose(image(local, touched), drawn_slowly(local, touched), atol=1e-6)


def test_a_cloud_without_touches_has_empty_layers_of_touches():
    drawn = image(ViewFrame.of(SEEN, UP).local(SEEN), NOTHING)
    assert drawn.dtype == np.float32
    assert not drawn[2:].any()
    assert 0.4 < drawn[1].mean() < 0.8


def test_the_frame_looks_along_the_line_of_sight_and_back():
    towards = Rotation.random(random_state=3).apply(UP)
    frame = ViewFrame.of(SEEN, towards)
    np.testing.assert_allclose(frame.axes[:, 2], towards, atol=1e-12)
    np.testing.assert_allclose(frame.axes.T @ frame.axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(frame.axes) == pytest.approx(1)
    local = frame.local(SEEN)
    np.testing.assert_allclose(frame.back(local), SEEN, atol=1e-9)
    assert np.abs(local[:, :2]).max() == pytest.approx(1)
    assert HALF > 1


def test_the_image_turns_moves_and_grows_with_the_cloud():
    bent = SEEN + np.column_stack([0.1 * SEEN[:, 0] ** 2, np.zeros((len(SEEN), 2))])  # nothing is symmetric
    turn = Rotation.random(random_state=4).as_matrix()
    moved = 7 * bent @ turn.T + 40
    drawn = image(ViewFrame.of(bent, UP).local(bent), NOTHING)
    again = image(ViewFrame.of(moved, turn @ UP).local(moved), NOTHING)
    assert (np.abs(drawn - again) < 1e-3).mean() > 0.98  # rounding moves single pixels
