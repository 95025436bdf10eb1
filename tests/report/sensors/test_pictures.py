"""Pictures of presses and readings: their pixels, sizes and captions."""

import base64
import io

import numpy as np
import pytest
from PIL import Image

from pcsr import UserError
from pcsr.report.colours import VALUE_SCALE, value_colours
from pcsr.report.sensors.change_picture import WIDEST, change_picture
from pcsr.report.sensors.touch_picture import GAP, LINE, WIDTHS, touch_picture
from pcsr.sensors import shaded
from tests.sensors.synthetic import SIZE, background, ball, calibrated, photo


def decoded(url):
    kind, _, data = url.partition(",")
    assert kind == "data:image/jpeg;base64"
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data)))).astype(int)


def test_an_unchanged_image_is_grey_and_a_press_is_not():
    grey = decoded(change_picture(background(0), background(1)))
    assert grey.shape == (*SIZE, 3)
    assert np.abs(grey - 127).max() < 25
    shown = decoded(change_picture(photo(ball(0.8, (40.0, 60.0))), background()))
    assert np.abs(shown[50:70, 30:50] - 127).max() > 60
    assert np.abs(shown[:, 100:] - 127).max() < 25


def test_large_images_become_small_pictures():
    side = 0.01
    image, rest = (shaded(np.full((1200, 1600), 0.0), side, np.random.default_rng(seed)) for seed in (0, 1))
    url = change_picture(image, rest)
    assert decoded(url).shape == (WIDEST * 3 // 4, WIDEST, 3)
    assert len(url) < 5e6 / 50
    with pytest.raises(UserError, match="pixels, but its background"):
        change_picture(image[:-1], rest)


@pytest.mark.parametrize("enlarged", [1, 6])
def test_a_reading_is_drawn_in_three_panels(enlarged):
    image = photo(ball(0.8, (40.0, 60.0)))
    reading = calibrated().read(image, background())
    if enlarged > 1:
        image, indentation, contact = (
            np.repeat(np.repeat(one, enlarged, 0), enlarged, 1) for one in (image, reading.indentation, reading.contact)
        )
        reading = type(reading)(indentation, contact, reading.points, reading.errors, reading.area, None)
    picture = np.asarray(Image.open(io.BytesIO(touch_picture(image, reading)))).astype(int)
    width = WIDTHS[0] if enlarged == 1 else WIDTHS[1]
    height = width * 3 // 4
    assert picture.shape == (height + LINE, 3 * width + 2 * GAP, 3)
    panels = [picture[LINE:, k * (width + GAP) :][:, :width] for k in range(3)]
    middle, side = (height // 2, width // 4), (height // 2, width - 20)
    assert np.abs(panels[0][side] - image[60 * enlarged, 147 * enlarged]).max() < 20
    assert np.abs(panels[1][middle] - value_colours(np.ones(1))[0].astype(int)).max() < 30
    assert np.abs(panels[1][side] - value_colours(np.zeros(1))[0].astype(int)).max() < 30
    assert np.ptp(panels[2][middle]) > 60  # marked
    assert np.ptp(panels[2][side]) == 0  # grey
    assert (picture[:LINE] < 100).any()  # captions


def test_colours_are_those_of_the_scale():
    found = value_colours(np.array([[place for place, _ in VALUE_SCALE]]))
    assert [bytes(one.tolist()).hex() for one in found[0]] == [colour[1:] for _, colour in VALUE_SCALE]
    between = value_colours(np.array(0.125)).astype(int)
    np.testing.assert_allclose(between, found[0, :2].astype(int).mean(0), atol=1)
