"""Touch of one finger: its data files are read and converted to the object's frame."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import read_cloud
from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.files import inside
from pcsr.recorded.camera_images import image_touch
from pcsr.recorded.gel_images import Contact, depth_touch, height_touch
from pcsr.recorded.manifest import CloudEntry, DepthEntry, Entry, HeightEntry, ImageEntry, RecordingManifest
from pcsr.recorded.pose import rotation_from, sensor_to_object, transformed

WIDER = 1.5
"""A touch may be this many times as wide as what its sensor sees."""
ERROR = "error"
"""Column of a cloud that holds the expected error of each point, in the cloud's unit."""


def finger_touch(folder: Path, recorded: RecordingManifest, entry: Entry) -> Touch:
    """Read the touch of one finger.

    Args:
        folder: folder of the recording.
        recorded: manifest of the recording, with what all touches have in common.
        entry: entry of the finger.

    Raises:
        UserError: a file cannot be read, the pose is missing or invalid, or there is no contact.
    """
    pose = None
    if entry.pose is not None:
        pose = sensor_to_object(entry.pose, recorded.unit, recorded.object_unit, recorded.object_pose)
    sensor = entry.sensor or recorded.sensor
    # The axes "-z" are pcsr's own. Multiplying by the identity could change the sign of a zero.
    sensor_pose = pose if pose is None or recorded.axes == "-z" else pose @ rotation_from(recorded.axes)
    if isinstance(entry, CloudEntry):
        cloud = Cloud(np.zeros((0, 3))) if entry.cloud is None else read_cloud(inside(folder, entry.cloud))
        unit = entry.unit or recorded.unit
        points = _in_object(cloud.points, unit, recorded, pose)
        _check_view(points, sensor_pose, entry.view)
        errors = _errors(cloud, unit / recorded.object_unit)
        return Touch.single(points, sensor_pose, recorded.object_unit, sensor, entry.contact_area, entry.view, errors)
    if sensor_pose is None:
        raise UserError("pose is missing: an image is in the frame of the sensor; add it")
    errors = None
    if isinstance(entry, ImageEntry):
        reading = image_touch(folder, entry, recorded)
        touched, area, view = reading.points, reading.area, reading.view
        errors = reading.errors / recorded.object_unit
    else:
        touched, area, view = _contact(folder, entry, sensor)
    points = transformed(sensor_pose, touched)
    return Touch.single(points, sensor_pose, recorded.object_unit, sensor, area, view, errors)


def _errors(cloud: Cloud, scale: float) -> Float[np.ndarray, " n"] | None:
    """Return the column of the points' errors, times the scale; None if there is none.

    Raises:
        UserError: an error is negative or not finite.
    """
    if ERROR not in cloud.columns:
        return None
    errors = np.asarray(cloud.columns[ERROR], np.float64)
    if errors.ndim != 1 or not (np.isfinite(errors) & (errors >= 0)).all():
        raise UserError(f"column '{ERROR}' holds the expected error of each point: it must be finite, and 0 or more")
    return errors * scale


def _check_view(
    points: Float[np.ndarray, "n 3"], pose: Float[np.ndarray, "4 4"] | None, view: tuple[float, float] | None
) -> None:
    """Check that a sensor sees what it touched.

    Raises:
        UserError: the points are far wider than the view.
    """
    if view is None or pose is None or len(points) == 0:
        return
    width, height = np.ptp(transformed(np.linalg.inv(pose), points)[:, :2], axis=0)
    if width > WIDER * view[0] or height > WIDER * view[1]:
        raise UserError(
            f"view: the sensor sees {view[0]:.4g} × {view[1]:.4g} mm, but its points are {width:.4g} × {height:.4g} mm "
            f"wide: give the sides of what it sees in millimetres, along x and y of the sensor"
        )


def _in_object(
    points: Float[np.ndarray, "n 3"], unit: float, recorded: RecordingManifest, pose: Float[np.ndarray, "4 4"] | None
) -> Float[np.ndarray, "n 3"]:
    """Convert the points of a cloud to the object's frame and unit."""
    if recorded.frame == "object":
        return points if unit == recorded.object_unit else points * (unit / recorded.object_unit)
    if pose is None:
        raise UserError("pose is missing: the cloud is in the sensor's frame; add it")
    return transformed(pose, points * unit)


def _contact(folder: Path, entry: Entry, sensor: str) -> Contact:
    """Read the contact of an image, in pcsr's sensor frame."""
    if isinstance(entry, HeightEntry):
        return height_touch(folder, entry, sensor)
    assert isinstance(entry, DepthEntry)
    return depth_touch(folder, entry, sensor)
