"""Heights of other programs are to scale again."""

import numpy as np
import pytest

from pcsr import UserError
from pcsr.sensors.foreign_heights import INTEGRATIONS, corrected
from pcsr.sensors.integration import integrated
from tests.sensors.other_programs import gs_sdk, gsrobotics


def dent(h=48, w=64, middle=(20.0, 35.0), width=4.0):
    """A round dent that is flat at the edges of the image, with its slopes."""
    v, u = np.mgrid[:h, :w].astype(float)
    surface = -6 * np.exp(-((u - middle[1]) ** 2 + (v - middle[0]) ** 2) / (2 * width**2))
    slopes = np.stack([-surface * (u - middle[1]), -surface * (v - middle[0])], axis=-1) / width**2
    return surface, slopes


def test_the_surface_of_gs_sdk_comes_back():
    surface, slopes = dent()
    theirs = gs_sdk(slopes)
    assert 1.1 < np.ptp(theirs) / np.ptp(surface) < 1.5
    found = corrected(theirs, "gs_sdk")
    np.testing.assert_allclose(found, integrated(slopes), atol=0.002)
    np.testing.assert_allclose(found, surface - surface.mean(), atol=0.06)


def test_the_surface_of_gsrobotics_comes_back():
    surface, _ = dent()
    # The slope at a pixel is taken for the step to it from the pixel before.
    steps = np.stack([np.diff(surface, axis=1, prepend=surface[:, :1]), np.diff(surface, axis=0, prepend=0)], axis=-1)
    steps[0, :, 1] = 0
    theirs = gsrobotics(steps)
    assert 0.55 < np.ptp(theirs) / np.ptp(surface) < 0.75
    np.testing.assert_allclose(corrected(theirs, "gsrobotics"), surface - surface.mean(), atol=0.002)


def test_with_slopes_at_the_pixels_the_surface_of_gsrobotics_lies_less_than_half_a_pixel_aside_each_way():
    surface, slopes = dent()
    found = corrected(gsrobotics(slopes), "gsrobotics")
    assert np.ptp(found) == pytest.approx(np.ptp(surface), rel=0.02)
    steepest = np.abs(slopes).max()
    assert np.abs(found - (surface - surface.mean())).max() < np.sqrt(0.5) * steepest
    # The deepest place, between the pixels, is left of and above that of the dent.
    for axis, k in ((0, 20), (1, 35)):
        before, at, after = np.take(np.take(found, 35 if axis == 0 else 20, 1 - axis), [k - 1, k, k + 1])
        assert -0.5 < (before - after) / (2 * (before - 2 * at + after)) < -0.25


@pytest.mark.parametrize(("program", "integrate"), [("gs_sdk", gs_sdk), ("gsrobotics", gsrobotics)])
def test_slopes_of_any_kind_come_back_but_for_the_edges(program, integrate):
    slopes = np.zeros((14, 17, 2))
    slopes[2:-2, 2:-2] = np.random.default_rng(0).normal(size=(10, 13, 2))
    found = corrected(integrate(slopes), program)
    if program == "gs_sdk":
        expected = integrated(slopes)
    else:  # the step from a pixel to the next is the slope at the next: its mean with one that cancels the rest
        alternate = np.zeros_like(slopes)
        for axis in (0, 1):
            total = np.moveaxis(alternate[..., axis], 1 - axis, 0)
            step = np.moveaxis(slopes[..., axis], 1 - axis, 0)
            for k in range(1, len(total)):
                total[k] = 2 * step[k] - total[k - 1]
        expected = integrated(alternate)
    np.testing.assert_allclose(found, expected, atol=1e-10)


def test_a_difference_of_two_maps_is_corrected_like_each():
    rng = np.random.default_rng(1)
    first, second = rng.normal(size=(2, 9, 12))
    for program in ("gs_sdk", "gsrobotics"):
        apart = corrected(first, program) - corrected(second, program)
        np.testing.assert_allclose(corrected(first - second, program), apart, atol=1e-9)


def test_exact_heights_stay():
    heights = np.array([[1.0, np.nan], [3.0, 4.0]])
    assert corrected(heights, "exact") is heights
    assert set(INTEGRATIONS) == {"exact", "gs_sdk", "gsrobotics"}


def test_only_a_whole_image_is_corrected():
    heights = np.zeros((4, 5))
    heights[1, 2] = np.nan
    with pytest.raises(UserError, match=r"corrected only for a whole image, and 1 of its 20 pixels are not finite"):
        corrected(heights, "gs_sdk")
