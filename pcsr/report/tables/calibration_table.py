"""Table of the errors of a sensor's calibration on held-out presses."""

from pcsr.report.tables.text_table import TextTable
from pcsr.sensors import Calibrated
from pcsr.sensors.figures import summary

HEADS = [
    "ball mm",
    "presses",
    "radius error %",
    "radius 90 %",
    "shape mm",
    "true ball mm",
    "cap height %",
    "cap error %",
    "contact area %",
]
"""Heads of the columns."""
NOTE = (
    "Medians of the held-out presses. Radius error: of the sphere that fits the measured surface best; its 90 % "
    "quantile. Shape: root mean square distance of the surface from that sphere; true ball: from a sphere of the true "
    "radius. Cap height: height of the ball above the rim of the contact, in per cent of the true one; its root mean "
    "square error. Contact area: in per cent of the disc within that rim."
)
"""Meaning of the columns."""


def how_measured(made: Calibrated) -> str:
    """Say on which presses the errors were measured."""
    count = len(made.held_out)
    if made.fits:
        return f"{count} presses by cross-validation, in {made.fits} fits that each leave some of them out"
    return f"{count} presses that are not used in the fit"


def calibration_table(made: Calibrated) -> TextTable:
    """Table of the errors by the diameter of the ball, and of all presses together."""
    by_ball = {
        f"{diameter:g}": [press for press in made.held_out if press.diameter == diameter]
        for diameter in sorted({press.diameter for press in made.held_out})
    }
    if len(by_ball) > 1:
        by_ball["all"] = made.held_out
    rows = []
    for name, presses in by_ball.items():
        of = summary(presses)
        rows.append(
            [
                name,
                str(of.presses),
                f"{100 * of.radius_median:.1f}",
                f"{100 * of.radius_90:.1f}",
                f"{of.shape:.4f}",
                f"{of.ball:.4f}",
                f"{100 * of.cap:.1f}",
                f"{100 * of.cap_spread:.1f}",
                f"{100 * of.area:.0f}",
            ]
        )
    return TextTable(f"errors on {how_measured(made)}", HEADS, rows, NOTE)
