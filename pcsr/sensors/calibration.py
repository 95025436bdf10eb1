"""Calibration of a tactile sensor: converts its images to indentations and points in contact."""

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

from pcsr.errors import UserError
from pcsr.sensors import polynomial
from pcsr.sensors.background import OTHER_SENSOR, check_not_swapped, check_orientation, coarse, difference
from pcsr.sensors.calibration_file import read_fields, write_fields
from pcsr.sensors.colour import changed, check_exposure, colour_change
from pcsr.sensors.contact import NoContactError, in_contact
from pcsr.sensors.figures import Figures
from pcsr.sensors.gels import THICKEST, Gel
from pcsr.sensors.images import Image
from pcsr.sensors.integration import integrated
from pcsr.sensors.reading import Reading

SHALLOWEST = 0.05
"""Greatest indentation, in millimetres, up to which an image shows no contact."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """Calibration of a camera-based tactile sensor, such as a DIGIT or a GelSight.

    `pcsr.sensors.calibrate` makes one from images of a ball that is pressed into the gel.

    Examples:
        >>> from pcsr.sensors import Calibration, PressImage, ball_indentation, calibrate, gel, shaded
        >>> def pressed(x, y):
        ...     return shaded(ball_indentation((120, 160), 0.12, 6.0, 0.8, (x, y)), 0.12)
        >>> places = [(x, y) for x in (40.0, 80.0, 120.0) for y in (35.0, 60.0, 85.0)]
        >>> presses = [PressImage(f"{x} {y}", pressed(x, y), 6.0) for x, y in places]
        >>> background = shaded(np.zeros((120, 160)), 0.12)
        >>> made = calibrate(presses, background, mm_per_pixel=0.12, sensor="mine", gel=gel("mine"))
        >>> made.calibration.save("mine.json")
        >>> reading = Calibration.load("mine.json").read(pressed(70.0, 50.0), background)
        >>> print(f"{reading.indentation.max():.1f} mm")
        0.8 mm
        >>> made.calibration.check_background(background // 3, "a dark image")
        Traceback (most recent call last):
            ...
        pcsr.errors.UserError: a dark image differs by ...
    """

    sensor: str
    """Name of the sensor."""
    gel: Gel
    """Shape of the gel."""
    columns: int
    """Width of the images in pixels."""
    rows: int
    """Height of the images in pixels."""
    mm_per_pixel: float
    """Side of a pixel on the gel."""
    coefficients: Float[np.ndarray, "k 2"]
    """Coefficients of the polynomials of the slopes along x and y: see `pcsr.sensors.polynomial`."""
    figures: Figures
    """Errors on held-out presses."""
    background: Float[np.ndarray, "r c 3"]
    """Mean colours of the background of the calibration in a coarse grid, by which another sensor's is recognized."""

    @classmethod
    def load(cls, path: Path | str) -> "Calibration":
        """Read a calibration from a JSON file.

        Raises:
            UserError: the file does not exist, is damaged, or holds numbers that no calibration has.
        """
        return cls(**read_fields(Path(path)))

    def save(self, path: Path | str) -> None:
        """Write the calibration to a JSON file.

        Raises:
            RunError: the file cannot be written.
        """
        write_fields(Path(path), {field.name: getattr(self, field.name) for field in fields(self)})

    def read(self, image: Image, background: Image) -> Reading:
        """Measure a touch.

        Args:
            image: camera image of the touch.
            background: image of the untouched gel by the same sensor, best of the same minute.

        Raises:
            UserError: the size of an image is not that of the calibration; an image is black, saturated, grey, cut off,
                turned, of another exposure or changed almost everywhere; the background shows a touch, or is of another
                sensor; or the indentation is deeper than the gel.
            NoContactError: there is no contact.
        """
        self._check_size(image, "it")
        self.check_background(background, "its background")
        check_not_swapped(coarse(image), coarse(background), self.background)
        slopes, touched = slopes_of(colour_change(image, background), self.coefficients)
        indentation = integrated(slopes) * self.mm_per_pixel
        indentation -= np.median(indentation[~touched]) if not touched.all() else indentation.min()
        contact = in_contact(indentation, at_least=SHALLOWEST)
        if not contact.any():
            raise NoContactError(
                f"no contact: the gel is indented by {max(0.0, indentation.max()):.2f} mm at most, less than "
                f"{SHALLOWEST} mm"
            )
        deepest = indentation[contact].max()
        thickest = THICKEST if self.gel.thickness is None else self.gel.thickness
        if deepest > thickest:
            gel = "such gels are" if self.gel.thickness is None else "the gel is"
            raise UserError(
                f"it is indented by {deepest:.1f} mm, but {gel} {thickest:g} mm thick at most: it is torn, or its "
                f"background or calibration is of another sensor"
            )
        rows, columns = np.nonzero(contact)
        plane = np.column_stack([columns - (self.columns - 1) / 2, (self.rows - 1) / 2 - rows]) * self.mm_per_pixel
        depth = indentation[contact]
        return Reading(
            indentation=indentation,
            contact=contact,
            points=np.column_stack([plane, depth - self.gel.sag(plane, self.columns, self.rows)]),
            errors=self.figures.errors(depth),
            area=float(contact.sum()) * self.mm_per_pixel**2,
            view=None if self.gel.dome else (self.columns * self.mm_per_pixel, self.rows * self.mm_per_pixel),
        )

    def check_background(self, background: Image, what: str) -> None:
        """Check that an image can be the background of touches by this sensor.

        Args:
            background: the image.
            what: what it is, for the message: "its background".

        Raises:
            UserError: its size is another, it is black, saturated or grey, it is turned or its colours are swapped, or
                it is of another sensor.
        """
        self._check_size(background, what)
        check_exposure(background, what)
        colours = coarse(background)
        check_orientation(colours, self.background, what, "that of the calibration")
        apart = difference(colours, self.background)
        if apart > OTHER_SENSOR:
            raise UserError(
                f"{what} differs by {apart:.0%} from that of the calibration: it is of another sensor than "
                f"'{self.sensor}', or of another light; calibrate that one"
            )

    def _check_size(self, image: Image, what: str) -> None:
        if image.shape[:2] != (self.rows, self.columns):
            raise UserError(
                f"{what} has {image.shape[1]} x {image.shape[0]} pixels, but the calibration of sensor '{self.sensor}' "
                f"is for {self.columns} x {self.rows}: use images as the calibration had"
            )


def slopes_of(
    change: Float[np.ndarray, "rows columns 3"], coefficients: Float[np.ndarray, "k 2"]
) -> tuple[Float[np.ndarray, "rows columns 2"], Bool[np.ndarray, "rows columns"]]:
    """Compute the slopes of the indentation along x (columns) and y (rows).

    Args:
        change: change of colour in per cent, of `pcsr.sensors.colour.colour_change`.
        coefficients: coefficients of a calibration.

    Returns:
        The slopes, 0 where the colour did not change; and the mask of the pixels where it did.
    """
    touched = changed(change)
    rows, columns = np.nonzero(touched)
    found = np.zeros((*touched.shape, 2))
    values = polynomial.monomials(change[rows, columns], rows * 1.0, columns * 1.0, touched.shape)
    found[rows, columns] = polynomial.slopes(values, coefficients)
    return found, touched
