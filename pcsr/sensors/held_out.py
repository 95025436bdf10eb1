"""Measurement of a calibration on presses that were held out of its fit."""

import numpy as np

from pcsr.errors import UserError
from pcsr.sensors.balls import distance_to_ball, fitted_sphere, rim_radius, voted_centre
from pcsr.sensors.calibration import SHALLOWEST, Calibration, slopes_of
from pcsr.sensors.contact import in_contact
from pcsr.sensors.figures import PressFigures
from pcsr.sensors.fitting import INNER, START
from pcsr.sensors.integration import integrated
from pcsr.sensors.presses import CUT_OFF, Press, cut_off

STEPS = 5
"""Times that the centre and the rim are found in turn."""
TOP = 2.0
"""Radius of the disc, in pixels, whose mean height is that of the cap's top."""


def measured(calibration: Calibration, press: Press) -> PressFigures:
    """Measure a ball with a calibration that was fitted without its press.

    The sphere is fitted within 0.9 of the contact's radius. The rim of the contact is where the measured slopes are
    steepest, so that the area, which is of the rule of contact, is compared with another measurement.

    Raises:
        UserError: the calibration finds no whole ball.
    """
    gel, scale = calibration.gel, calibration.mm_per_pixel
    found, touched = slopes_of(press.change, calibration.coefficients)
    indentation = integrated(found)
    indentation -= np.median(indentation[~touched]) if not touched.all() else indentation.min()
    height, width = indentation.shape
    rows, columns = (one.ravel().astype(float) for one in np.mgrid[:height, :width])
    middle = np.column_stack([columns - (width - 1) / 2, rows - (height - 1) / 2])
    radii = gel.radii(width, height)
    sag = np.zeros(2) if radii is None else scale / np.array(radii)
    of_ball = found.reshape(-1, 2) - middle * sag
    surface = indentation.ravel() - (middle**2 * sag / 2).sum(1)

    centre, rim = press.centre, START * min(press.radius, press.ball)
    for _ in range(STEPS):
        near = np.hypot(columns - centre[0], rows - centre[1]) < INNER * rim
        centre = voted_centre(columns[near], rows[near], of_ball[near], press.ball)
        if np.hypot(*(centre - press.centre)) > press.radius:
            raise UserError("the calibration finds no ball in it")
        rim = rim_radius(columns, rows, of_ball, centre, press.ball)
    if cut_off(press, centre, rim):
        raise UserError(CUT_OFF)
    distance = np.hypot(columns - centre[0], rows - centre[1])
    cap = distance < INNER * rim
    points = np.column_stack([columns, rows, surface])[cap]
    middle_of_sphere, radius = fitted_sphere(points)
    top = surface[distance < TOP].mean() - surface[np.abs(distance - rim) < 1].mean()
    contact = in_contact(indentation, at_least=SHALLOWEST / scale)
    return PressFigures(
        name=press.name,
        diameter=press.diameter,
        radius_ratio=radius / press.ball,
        shape=float(np.std(np.linalg.norm(points - middle_of_sphere, axis=1))) * scale,
        ball=float(np.sqrt(np.mean(distance_to_ball(points, press.ball) ** 2))) * scale,
        cap_ratio=float(top / (press.ball - np.sqrt(press.ball**2 - rim**2))),
        area_ratio=float(contact.sum() / (np.pi * rim**2)),
        depth=float(indentation.max()) * scale,
    )
