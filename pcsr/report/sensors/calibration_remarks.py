"""What is odd about a calibration."""

import numpy as np

from pcsr.sensors import Calibrated

LARGE_RADIUS = 0.1
"""Median error of the radius above which a calibration is poor. On real sensors it is 0.02 to 0.04."""
LARGE_CAP = 0.2
"""Root mean square error of the cap's height above which a calibration is poor. On real sensors it is 0.04 to 0.15."""
NARROW = 0.3
"""Least part of the width and of the height of the image over which presses are spread."""


def calibration_remarks(made: Calibrated) -> list[str]:
    """Return one line for each thing that is odd; refused presses are not among them."""
    figures, calibration = made.calibration.figures, made.calibration
    lines = []
    if figures.radius_median > LARGE_RADIUS or figures.cap_spread > LARGE_CAP:
        lines.append(
            "the errors are large, and what this calibration measures is about as wrong: check the diameters of the "
            "balls and --mm-per-pixel, fix the exposure, and press more often, at places spread over the gel"
        )
    centres = np.array([place.centre for place in made.places.values()])
    width, height = np.ptp(centres, axis=0) / [calibration.columns, calibration.rows]
    for part, side in ((width, "width"), (height, "height")):
        if part < NARROW:
            lines.append(
                f"the balls lie within {part:.0%} of the image's {side}: elsewhere the calibration is extrapolated; "
                f"press at places spread over the gel"
            )
    return lines
