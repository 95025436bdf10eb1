"""The change of colour: against one that is written out, and what it refuses."""

import numpy as np
import pytest

from pcsr import UserError
from pcsr.sensors.colour import DARKEST, MARGIN, UNCHANGED, changed, colour_change, strength


def pair(h=41, w=55, seed=0):
    rng = np.random.default_rng(seed)
    background = rng.integers(5, 200, (h, w, 3)).astype(np.uint8)
    image = background.copy()
    image[10:20, 15:30] = rng.integers(5, 200, (10, 15, 3))
    return image, background


def test_it_is_the_change_in_per_cent_less_its_median():
    image, background = pair()
    image = np.clip(image + np.random.default_rng(1).integers(-3, 4, image.shape), 0, 255).astype(np.uint8)
    found = colour_change(image, background)
    for k in range(3):
        apart = image[..., k].astype(float) - background[..., k]
        expected = 100 * (apart - np.median(apart)) / np.maximum(background[..., k], DARKEST)
        np.testing.assert_allclose(found[..., k], expected, atol=1e-12)


@pytest.mark.parametrize("drift", [(9, -4, 0), (-5, -5, -5), (12, 8, 4)])
def test_a_drift_of_the_light_is_taken_off(drift):
    image, background = pair()
    drifted = (image + np.array(drift)).astype(np.uint8)
    np.testing.assert_allclose(colour_change(drifted, background), colour_change(image, background), atol=1e-12)


def test_only_the_touched_part_and_a_margin_around_it_changed():
    image, background = pair()
    mask = changed(colour_change(image, background))
    rows, columns = np.nonzero(mask)
    assert mask[10:20, 15:30].all()
    assert rows.min() == 10 - MARGIN - 2
    assert columns.max() <= 29 + MARGIN + 2
    assert not changed(colour_change(background, background)).any()
    assert not changed(np.full((30, 30, 3), UNCHANGED - 0.1)).any()


def test_the_strength_is_the_greatest_of_the_three():
    change = np.random.default_rng(0).normal(size=(6, 7, 3))
    np.testing.assert_array_equal(strength(change), np.abs(change).max(axis=-1))


def cut_off(image, filled):
    """An image whose last rows did not arrive."""
    return np.concatenate([image[:-5], np.full_like(image[-5:], filled)])


def test_rows_with_a_few_pixels_of_one_colour_are_whole():
    image, background = pair()
    image[:, [0, image.shape[1] // 2, -1]] = background[:, [0, image.shape[1] // 2, -1]] = 50
    colour_change(image, background)


def test_rows_of_one_colour_that_the_background_has_too_are_no_loss():
    image, background = (cut_off(one, 0) for one in pair())
    assert (colour_change(image, background)[-5:] == 0).all()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda image, background: (image[1:], background), "it has 55 x 40 pixels, but its background 55 x 41"),
        (lambda image, background: (image // 40, background), "it is black, at a mean level of"),
        (lambda image, background: (image, background // 40), "its background is black"),
        (lambda image, background: (image | 255, background), "it is saturated at 100% of its pixels"),
        (lambda image, background: (image, background | 255), "its background is saturated"),
        (
            lambda image, background: (np.roll(image, 7, 0), background),
            "differ from its background's almost everywhere",
        ),
        (lambda image, background: (np.repeat(image[..., :1], 3, 2), background), "it is grey: a camera image has red"),
        (lambda image, background: (image, np.repeat(background[..., :1], 3, 2)), "its background is grey"),
        (lambda image, background: (cut_off(image, 0), background), "5 of its 41 rows have one colour: it was cut off"),
        (lambda image, background: (cut_off(image, 128), background), "5 of its 41 rows have one colour"),
        (
            lambda image, background: (image + np.uint8(20), background),
            "its light differs by 20% from its background's",
        ),
    ],
)
def test_what_is_no_touch_is_refused(spoil, message):
    with pytest.raises(UserError, match=message):
        colour_change(*spoil(*pair()))
