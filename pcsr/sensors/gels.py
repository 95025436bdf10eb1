"""Shapes of the gels of known sensors."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcsr.errors import UserError

THICKEST = 10.0
"""Greatest indentation in millimetres of a gel whose thickness is not known."""
WIDEST = 100.0
"""Greatest side of what a sensor sees in millimetres."""


@dataclass(frozen=True)
class Gel:
    """Shape of an untouched gel. Lengths are in millimetres.

    Examples:
        >>> from pcsr.sensors import gel
        >>> gel("digit").radii(320, 240)  # where the image is wider than high
        (50.0, 23.0)
        >>> gel("digit").sag(np.array([[0.0, 5.0]]), 320, 240).round(2)
        array([0.54])
    """

    dome: tuple[float, float] | None = None
    """Radii of the face's curvature along the longer and the shorter side of the image; None for a flat face."""
    thickness: float | None = None
    """Thickness of the gel, which no indentation exceeds; None if it is unknown."""

    def radii(self, columns: int, rows: int) -> tuple[float, float] | None:
        """Return the radii of curvature along x and y of an image of this size; None for a flat face."""
        if self.dome is None:
            return None
        return self.dome if columns >= rows else (self.dome[1], self.dome[0])

    def sag(self, points: Float[np.ndarray, "n 2"], columns: int = 1, rows: int = 1) -> Float[np.ndarray, " n"]:
        """Compute how far the untouched face lies behind its centre.

        Args:
            points: positions along x and y from the centre of the face.
            columns: width of the image in pixels.
            rows: height of the image in pixels.
        """
        radii = self.radii(columns, rows)
        if radii is None:
            return np.zeros(len(points))
        sag: Float[np.ndarray, " n"] = (points**2 / (2 * np.array(radii))).sum(1)
        return sag


GELS = {
    "digit": Gel(dome=(50.0, 23.0), thickness=5.0),
    "gelsight-mini": Gel(thickness=4.25),
}
"""Gels by the name of the sensor. The dome of a DIGIT is fitted to its published model; its thickness is a bound. The
thickness of a GelSight Mini's gel is the vendor's figure."""


def gel(sensor: str) -> Gel:
    """Return the shape of a sensor's gel. A sensor of another name has a flat face.

    Raises:
        UserError: the name is a misspelt one of a known sensor.

    Examples:
        >>> from pcsr.sensors import gel
        >>> gel("gelsight-mini").dome is None
        True
    """
    if sensor in GELS:
        return GELS[sensor]
    plain = "".join(letter for letter in sensor.lower() if letter.isalnum())
    for name in GELS:
        if plain == name.replace("-", ""):
            raise UserError(f"sensor '{sensor}' is written '{name}'")
    return Gel()


def check_width(columns: int, rows: int, mm_per_pixel: float) -> None:
    """Check that an image shows no more than a fingertip.

    Raises:
        UserError: the image is wider or higher than `WIDEST`.
    """
    width, height = columns * mm_per_pixel, rows * mm_per_pixel
    if max(width, height) <= WIDEST:
        return
    cause = "give the side of a pixel in mm"
    if mm_per_pixel > 1:
        cause = f"{mm_per_pixel:g} looks like pixels per mm: 1 / {mm_per_pixel:g} = {1 / mm_per_pixel:.3g}"
    raise UserError(
        f"mm_per_pixel: with {mm_per_pixel:g} the image is {width:.4g} × {height:.4g} mm, more than {WIDEST:g} mm: "
        f"{cause}"
    )


def check_view(gel: Gel, columns: int, rows: int, mm_per_pixel: float) -> None:
    """Check that images of a gel show no more than a fingertip, which is not more curved than one.

    Raises:
        UserError: the image is too wide, or its corners lie farther behind its centre than `THICKEST`.
    """
    check_width(columns, rows, mm_per_pixel)
    corner = np.array([[columns, rows]]) * mm_per_pixel / 2
    sag = float(gel.sag(corner, columns, rows)[0])
    if gel.dome is not None and sag > THICKEST:
        raise UserError(
            f"dome: with radii of {gel.dome[0]:g} and {gel.dome[1]:g} mm the corners of the gel lie {sag:.3g} mm "
            f"behind its centre, more than {THICKEST:g} mm: give the radii of the curvature in mm"
        )
