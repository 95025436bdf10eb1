"""Touches from the camera images of a calibrated sensor, of `image` entries."""

from pathlib import Path

from pcsr.errors import UserError
from pcsr.files import inside
from pcsr.recorded.manifest import ImageEntry, RecordingManifest
from pcsr.sensors import Calibration, Reading, read_rgb


def image_touch(folder: Path, entry: ImageEntry, recorded: RecordingManifest) -> Reading:
    """Read the contact of a camera image.

    Args:
        folder: folder of the recording.
        entry: entry of the touch.
        recorded: manifest of the recording, with the background and calibration of all touches.

    Raises:
        UserError: a file is missing or cannot be read, or the image shows no contact.
    """
    background, calibration = entry.background or recorded.background, entry.calibration or recorded.calibration
    if background is None:
        raise UserError("background is missing: name the image of the untouched gel, here or for the whole recording")
    if calibration is None:
        raise UserError(
            "calibration is missing: name the file of the sensor's calibration, which `pcsr sensor calibrate` makes, "
            "here or for the whole recording"
        )
    calibrated = Calibration.load(inside(folder, calibration))
    image, untouched = read_rgb(inside(folder, entry.image)), read_rgb(inside(folder, background))
    try:
        return calibrated.read(image, untouched)
    except UserError as error:
        raise UserError(f"{entry.image}: {error}") from error
