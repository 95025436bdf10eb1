"""Calibration as a whole: which presses are used, held out and refused, and that their order does not matter."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from pcsr import UserError, limits
from pcsr.sensors import Gel, PressImage, calibrate, median_background
from pcsr.sensors.calibrate import FOLDS
from tests.sensors.synthetic import PITCH, SIZE, background, ball, photo, presses


def made(given=None, rest=None, **options):
    given = presses() if given is None else given
    settings = {"mm_per_pixel": PITCH, "sensor": "x", "gel": Gel()} | options
    return calibrate(given, background() if rest is None else rest, **settings)


def named(images, prefix):
    return [replace(press, name=f"{prefix}{press.name}") for press in images]


def test_without_held_out_presses_each_is_measured_by_a_fit_without_it():
    calls = []
    found = made(progress=lambda *numbers: calls.append(numbers))
    assert sorted(press.name for press in found.held_out) == sorted(found.places) == sorted(p.name for p in presses())
    assert found.fits == FOLDS == 10
    assert calls == [(number, 11) for number in range(1, 12)]
    assert found.calibration.figures.presses == 12
    assert found.calibration.figures.radius_90 < 0.05
    assert made(presses(6)).fits == 6


def test_held_out_presses_are_in_no_fit():
    few = made(count=6)
    alone = made([press for press in presses() if press.name in few.places])
    assert len(few.places) == len(few.held_out) == 6
    assert few.fits == 0
    assert not few.places.keys() & {press.name for press in few.held_out}
    np.testing.assert_allclose(few.calibration.coefficients, alone.calibration.coefficients, atol=1e-9)


def test_presses_of_a_test_are_measured_and_not_fitted():
    test = named(presses(4, seed=5, diameter=8.0), "test ")
    found = made(test=test)
    assert {press.name for press in found.held_out} == {press.name for press in test}
    assert {press.diameter for press in found.held_out} == {8.0}
    np.testing.assert_array_equal(found.calibration.coefficients, made().calibration.coefficients)
    both = made(test=test, count=8)
    assert len(both.held_out) == 4 + 4


def test_the_order_of_the_presses_does_not_matter():
    order = np.random.default_rng(0).permutation(12)
    one, other = made(count=9), made([presses()[k] for k in order], count=9)
    np.testing.assert_allclose(one.calibration.coefficients, other.calibration.coefficients, rtol=1e-6, atol=1e-9)
    assert list(one.places) == list(other.places)
    assert one.calibration.figures.ball == pytest.approx(other.calibration.figures.ball, rel=1e-6)


def test_balls_of_two_diameters_are_fitted_together():
    found = made([*named(presses(6), "small "), *named(presses(6, seed=3, diameter=9.0), "large ")])
    assert found.refused == {}
    assert found.calibration.figures.radius_90 < 0.06


def test_presses_that_show_no_ball_are_refused_with_the_reason():
    bar = np.maximum(0.8 - np.abs(np.mgrid[: SIZE[0], : SIZE[1]][0] - 60) * PITCH, 0)
    bar = bar * (np.abs(np.arange(SIZE[1]) - 80) < 60)
    given = [
        *presses(),
        PressImage("bar", photo(bar), 6.0),
        PressImage("other ball", photo(ball(0.9)), 3.5),
        PressImage("untouched", background(5), 6.0),
        PressImage("edge", photo(ball(0.9, (8.0, 60.0))), 6.0),
        PressImage("small", photo(ball())[::2], 6.0),
    ]
    found = made(given)
    assert found.refused.keys() == {"bar", "other ball", "untouched", "edge", "small"}
    assert "from those of a ball of 3.5 mm" in found.refused["other ball"]
    assert len(found.places) == 12
    np.testing.assert_allclose(found.calibration.coefficients, made().calibration.coefficients, rtol=1e-6, atol=1e-9)


def test_a_refused_press_is_replaced_by_another():
    odd = PressImage("odd", photo(ball(0.9)), 3.5)  # in the middle, so that it is the first that is chosen
    found = made([*presses(), odd], count=8)
    assert found.refused.keys() == {"odd"}
    assert len(found.places) == 8
    assert len(found.held_out) == 4


def test_too_few_presses_are_an_error_with_the_reasons():
    given = [*presses(4), *(PressImage(f"rest {k}", background(k), 6.0) for k in range(30))]
    with pytest.raises(UserError, match="4 of 34 presses can be used, and a calibration needs 5, better 12") as caught:
        made(given, test=[PressImage("test", background(99), 6.0)])
    lines = str(caught.value).splitlines()
    assert len(lines) == 1 + 20 + 1
    assert lines[1].startswith("  rest 0: no ball")
    assert lines[-1] == "  and 10 more"


def test_an_image_that_is_given_twice_counts_once():
    copies = [PressImage(f"copy {k}", presses()[k].image.copy(), 6.0) for k in range(3)]
    found = made([*presses(), *copies[:2]], test=[copies[2]])
    assert found.refused == {f"copy {k}": f"it is the same image as {k}.png" for k in range(3)}
    assert len(found.places) == 12


def test_presses_that_show_no_balls_are_no_calibration():
    rng = np.random.default_rng(0)
    given = []
    for number in range(8):
        row, column = rng.integers(30, 70), rng.integers(30, 100)
        block = np.zeros(SIZE)
        block[row : row + 25, column : column + 25] = 0.8
        given.append(PressImage(f"{number}", photo(ndimage.gaussian_filter(block, 2.0), number), 6.0))
    with pytest.raises(UserError, match=r"the presses show no balls: .* degrees from those of a ball, and 1 to 5 are"):
        made(given)


def test_a_ball_of_thrice_the_size_is_too_large_for_its_contacts():
    given = [PressImage(one.name, one.image, 18.0) for one in presses()]
    with pytest.raises(
        UserError, match=r"narrower than 0\.3 of the ball's radius: press deeper, or correct the ball's"
    ):
        made(given)


def test_held_out_presses_without_a_ball_are_an_error():
    with pytest.raises(UserError, match="none of 1 held-out presses shows a whole ball\n  test: the ball is cut off"):
        made(test=[PressImage("test", photo(ball(0.9, (9.0, 60.0))), 6.0)])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mm_per_pixel": 0.0}, "mm_per_pixel is 0: it must be more than 0"),
        ({"mm_per_pixel": np.nan}, "mm_per_pixel is nan"),
        ({"sensor": ""}, "the sensor's name has 0 characters"),
        ({"sensor": "x" * 201}, "the sensor's name has 201 characters"),
        ({"sensor": "a\udcffb"}, r"the sensor's name is 'a\\udcffb': it must have no control characters"),
        ({"count": 4}, "4 presses are no calibration: fit at least 5"),
        ({"given": [*presses(6), presses(1)[0]]}, "2 presses are called '0.png': give each a name of its own"),
        ({"test": presses(1)}, "2 presses are called '0.png'"),
        ({"given": [replace(presses(1)[0], diameter=np.inf)]}, r"0\.png: a ball of inf mm: the diameter must be"),
        ({"given": []}, "0 of 0 presses can be used"),
        ({"rest": background() // 60}, "the background is black"),
        ({"rest": background() | 255}, "the background is saturated"),
    ],
)
def test_mistakes_in_the_arguments_are_named(options, message):
    with pytest.raises(UserError, match=message):
        made(**options)


def test_images_that_do_not_fit_into_memory_are_refused(monkeypatch):
    monkeypatch.setattr(limits, "free_memory", lambda: 1 << 20)
    monkeypatch.setattr(limits, "UNCHECKED_SIZE", 1 << 20)
    with pytest.raises(UserError, match=r"with 12 presses of 160 x 120 pixels needs about .*: make the images smaller"):
        made()


def test_the_median_of_presses_at_several_places_is_the_untouched_gel():
    found = median_background([press.image for press in presses()])
    assert np.abs(found.astype(int) - background()).mean() < 2
    exact = [np.full((2, 3, 3), level, np.uint8) for level in (9, 1, 7, 200, 3)]
    np.testing.assert_array_equal(median_background(exact), exact[2])
    with pytest.raises(UserError, match="the median of 4 presses is no background: give 5, or a background"):
        median_background(exact[:4])
    with pytest.raises(UserError, match="different sizes in pixels, 3 x 1 and 3 x 2"):
        median_background([*exact, exact[0][:1]])
