"""Calibration of a tactile sensor from images of a ball that is pressed into its gel."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcsr.errors import UserError
from pcsr.sensors.background import coarse
from pcsr.sensors.balls import RIM
from pcsr.sensors.calibration import Calibration
from pcsr.sensors.calibration_inputs import FEWEST, check_arguments, copies
from pcsr.sensors.figures import NO_FIGURES, Figures, PressFigures, summary
from pcsr.sensors.fitting import Fit, Place, fit
from pcsr.sensors.gels import Gel
from pcsr.sensors.held_out import measured
from pcsr.sensors.images import Image
from pcsr.sensors.presses import CUT_OFF, Press, PressImage, cut_off, press_of, spread

FOLDS = 10
"""Greatest number of fits for the errors on held-out presses."""
ODD = 3.0
"""A press whose slopes deviate from a ball's by this many times the median deviation is refused."""
ODD_ANGLE = np.radians(6.0)
"""Deviation in radians up to which no press is refused."""
NO_BALL_ANGLE = np.radians(8.0)
"""Median deviation in radians above which the presses show no balls. Those of real sensors reach 4 degrees."""
NARROW = 1.02
"""A rim that is found within this factor of the least that is looked for lies further inside."""

FITTED = " without its press: it is fitted, but not among the held-out ones"
"""Addition to the reason of a press that only the fit without it cannot measure."""
MOST_REASONS = 20
"""Most refused presses that a message lists."""


@dataclass(frozen=True)
class Calibrated:
    """A calibration, and how it was made.

    Examples:
        >>> from pcsr.sensors import PressImage, ball_indentation, calibrate, gel, shaded
        >>> def pressed(x, y):
        ...     return shaded(ball_indentation((120, 160), 0.12, 6.0, 0.8, (x, y)), 0.12)
        >>> places = [(x, y) for x in (40.0, 80.0, 120.0) for y in (35.0, 60.0, 85.0)]
        >>> presses = [PressImage(f"{x} {y}", pressed(x, y), 6.0) for x, y in places]
        >>> background = shaded(np.zeros((120, 160)), 0.12)
        >>> made = calibrate(presses, background, mm_per_pixel=0.12, sensor="mine", gel=gel("mine"), count=6)
        >>> len(made.places), len(made.held_out), made.refused
        (6, 3, {})
    """

    calibration: Calibration
    places: dict[str, Place]
    """Where the ball lies in each press that the calibration was fitted to, by the name of the press."""
    held_out: list[PressFigures]
    """Each held-out press, measured by a calibration that was fitted without it."""
    fits: int
    """Number of the fits of a cross-validation, each without some presses; 0 if the held-out presses are in no fit."""
    refused: dict[str, str]
    """Names of presses that cannot be used, with the reasons."""


def median_background(images: Sequence[Image]) -> Image:
    """Return the median of presses at different places, which shows the untouched gel.

    Raises:
        UserError: there are fewer than 5 images, or their sizes differ.

    Examples:
        >>> from pcsr.sensors import ball_indentation, median_background, shaded
        >>> centres = [(x, y) for x in (15.0, 65.0) for y in (15.0, 30.0, 45.0)]
        >>> images = [shaded(ball_indentation((60, 80), 0.2, 6.0, 0.3, centre), 0.2) for centre in centres]
        >>> untouched = shaded(np.zeros((60, 80)), 0.2)
        >>> float(abs(median_background(images) - untouched.astype(float)).mean()) < 1
        True
    """
    if len(images) < FEWEST:
        raise UserError(f"the median of {len(images)} presses is no background: give {FEWEST}, or a background")
    if len({image.shape for image in images}) > 1:
        sizes = sorted({f"{image.shape[1]} x {image.shape[0]}" for image in images})
        raise UserError(f"the presses have different sizes in pixels, {' and '.join(sizes)}: use images of one size")
    median: Image = np.median(np.stack(images), axis=0).astype(np.uint8)
    return median


def calibrate(
    presses: Sequence[PressImage],
    background: Image,
    *,
    mm_per_pixel: float,
    sensor: str,
    gel: Gel,
    test: Sequence[PressImage] = (),
    count: int | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Calibrated:
    """Calibrate a tactile sensor.

    Args:
        presses: images of one ball, or balls of several diameters, pressed into the gel at places spread over it.
        background: image of the untouched gel.
        mm_per_pixel: side of a pixel on the gel.
        sensor: name of the sensor.
        gel: shape of its gel.
        test: presses that are held out: the errors are measured on them.
        count: number of presses to fit, spread over the gel; the others are held out. None: all. If no press is held
            out, the errors are measured by cross-validation: each press with a calibration that was fitted without it.
        progress: called with the number of finished fits and their total.

    Raises:
        UserError: an argument is out of range, two presses have one name, the background is black or saturated, or
            fewer than 5 presses can be used or show a ball; the message lists the reasons.

    Examples:
        >>> from pcsr.sensors import PressImage, ball_indentation, calibrate, gel, shaded
        >>> def pressed(x, y):
        ...     return shaded(ball_indentation((120, 160), 0.12, 6.0, 0.8, (x, y)), 0.12)
        >>> places = [(x, y) for x in (40.0, 80.0, 120.0) for y in (35.0, 60.0, 85.0)]
        >>> presses = [PressImage(f"{x} {y}", pressed(x, y), 6.0) for x, y in places]
        >>> background = shaded(np.zeros((120, 160)), 0.12)
        >>> made = calibrate(presses, background, mm_per_pixel=0.12, sensor="mine", gel=gel("mine"))
        >>> made.calibration.figures.radius_median < 0.05
        True
    """
    check_arguments(presses, test, background, mm_per_pixel, sensor, gel, count)
    refused = copies([*presses, *test])
    usable = _usable(presses, background, mm_per_pixel, refused)
    radii = gel.radii(background.shape[1], background.shape[0])
    sag = np.zeros(2) if radii is None else mm_per_pixel / np.array(radii)
    chosen, whole = _fitted(usable, count, sag, refused)
    held = [press for press in usable if press not in chosen and press.name not in refused]
    held += _usable(test, background, mm_per_pixel, refused)
    folds = [] if held else [chosen[first::FOLDS] for first in range(min(FOLDS, len(chosen)))]

    def made(fitted: Fit, figures: Figures) -> Calibration:
        rows, columns = background.shape[:2]
        return Calibration(sensor, gel, columns, rows, mm_per_pixel, fitted.coefficients, figures, coarse(background))

    progress(1, 1 + len(folds))
    results = list(_measured(made(whole, NO_FIGURES), held, refused))
    for number, fold in enumerate(folds):
        part = fit([press for press in chosen if press not in fold], sag)
        results += _measured(made(part, NO_FIGURES), fold, refused, FITTED)
        progress(2 + number, 1 + len(folds))
    if not results:
        raise UserError(f"none of {len(held) or len(chosen)} held-out presses shows a whole ball{_reasons(refused)}")
    places = {press.name: place for press, place in zip(chosen, whole.places, strict=True)}
    return Calibrated(made(whole, summary(results)), places, results, len(folds), refused)


def _usable(
    presses: Sequence[PressImage], background: Image, mm_per_pixel: float, refused: dict[str, str]
) -> list[Press]:
    """Return the presses that show a changed region, and add the reasons of the others to `refused`."""
    usable = []
    for press in presses:
        if press.name in refused:
            continue
        try:
            usable.append(press_of(press, background, mm_per_pixel))
        except UserError as error:
            refused[press.name] = str(error)
    return usable


def _fitted(
    presses: Sequence[Press], count: int | None, sag: Float[np.ndarray, "2"], refused: dict[str, str]
) -> tuple[list[Press], Fit]:
    """Fit presses that are spread over the gel, and refuse those that show no whole ball until none is left."""
    left = list(presses)
    while len(left) >= FEWEST:
        order = spread(np.array([press.centre for press in left]), len(left) if count is None else count)
        chosen = [left[index] for index in order]
        fitted = fit(chosen, sag)
        reasons = _odd(chosen, fitted)
        usual = float(np.median([place.residual for place in fitted.places]))
        if not reasons and usual > NO_BALL_ANGLE:
            raise UserError(
                f"the presses show no balls: the slopes of half of them deviate by more than {np.degrees(usual):.0f} "
                f"degrees from those of a ball, and 1 to 5 are usual: check the images, the ball's diameter and "
                f"mm_per_pixel{_reasons(refused)}"
            )
        if not reasons:
            return chosen, fitted
        refused.update(reasons)
        left = [press for press in left if press.name not in reasons]
    raise UserError(
        f"{len(left)} of {len(left) + len(refused)} presses can be used, and a calibration needs {FEWEST}, better 12, "
        f"spread over the gel{_reasons(refused)}"
    )


def _odd(presses: Sequence[Press], fitted: Fit) -> dict[str, str]:
    """Return the reasons of the presses that show no whole ball, by name."""
    usual = float(np.median([place.residual for place in fitted.places]))
    reasons = {}
    for press, place in zip(presses, fitted.places, strict=True):
        if cut_off(press, place.centre, place.rim):
            reasons[press.name] = CUT_OFF
        elif place.rim < NARROW * RIM[0] * press.ball:
            reasons[press.name] = (
                f"its contact is narrower than {RIM[0]:g} of the ball's radius: press deeper, or correct the ball's "
                f"diameter ({press.diameter:g} mm) or mm_per_pixel"
            )
        elif place.residual > max(ODD * usual, ODD_ANGLE):
            reasons[press.name] = (
                f"its slopes deviate by {np.degrees(place.residual):.0f} degrees from those of a ball of "
                f"{press.diameter:g} mm, and the others' by {np.degrees(usual):.0f}: it shows something else, or a "
                f"ball of another diameter"
            )
    return reasons


def _measured(
    calibration: Calibration, presses: Sequence[Press], refused: dict[str, str], but: str = ""
) -> Iterator[PressFigures]:
    """Measure presses, and add the reasons of those that cannot be measured to `refused`."""
    for press in presses:
        try:
            yield measured(calibration, press)
        except UserError as error:
            refused[press.name] = f"{error}{but}"


def _reasons(refused: dict[str, str]) -> str:
    """Return the reasons of refused presses, a line each, and the number of those that are not listed."""
    lines = [f"\n  {name}: {reason}" for name, reason in list(refused.items())[:MOST_REASONS]]
    more = len(refused) - len(lines)
    return "".join(lines) + (f"\n  and {more} more" if more else "")
