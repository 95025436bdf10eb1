"""Reading of recordings: the manifest, the data files, and each touch converted to the object's frame."""

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.clouds.formats import read_points
from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.files import inside
from pcsr.inputs import read_bytes
from pcsr.limits import LARGEST_JSON, MOST_FINGERS, MOST_TOUCHED_POINTS, MOST_TOUCHES
from pcsr.recorded import layouts
from pcsr.recorded.images import depth_contact, height_contact, read_image, same_size
from pcsr.recorded.manifest import (
    CloudEntry,
    DepthEntry,
    Entry,
    GraspEntry,
    HeightEntry,
    LayoutManifest,
    RecordingManifest,
    check_entry,
    checked,
)
from pcsr.recorded.pickles.unpickle import load_numpy
from pcsr.recorded.pose import rotation_from, sensor_to_object, transformed

MANIFEST = "touches.json"
WIDER = 1.5
"""A touch may be this many times as wide as what its sensor sees."""
MOST_REASONS = 20
"""Greatest number of reasons in the message about a recording of which no touch is usable; further ones are counted."""


@dataclass(frozen=True)
class Recording:
    """Touches of one object, in its frame and unit.

    Examples:
        >>> touch = pcsr.Touch.single(np.zeros((20, 3)), None, unit=1.0, sensor="digit")
        >>> pcsr.recorded.write(Path("touches"), [touch], names=["front"])
        >>> pcsr.recorded.read("touches").names
        ['front']
    """

    touches: list[Touch]
    names: list[str]
    """Name of each touch, or else its file."""
    skipped: dict[str, str]
    """Names of unusable touches, with the reasons."""
    pose_error: PoseError | None = None
    """Error of the poses; None if the recording does not state it."""


def read(folder: Path | str) -> Recording:
    """Read a recording. Unusable touches are skipped and listed in `Recording.skipped` with the reason.

    Args:
        folder: folder of the recording, or its file `touches.json`.

    Raises:
        UserError: the manifest does not exist or has mistakes, or no touch is usable; the message lists the reasons.

    Examples:
        >>> touch = pcsr.Touch.single(np.zeros((20, 3)), None, unit=1.0, sensor="digit")
        >>> pcsr.recorded.write(Path("touches"), [touch], names=["front"])
        >>> recording = pcsr.recorded.read("touches")
        >>> len(recording.touches), recording.names, recording.skipped
        (1, ['front'], {})
    """
    folder = Path(folder)
    folder = folder.parent if folder.name == MANIFEST else folder
    path = folder / MANIFEST
    plain = _json(path)
    try:
        recorded = _manifest(plain)
        if isinstance(recorded, RecordingManifest):
            found = _listed(folder, recorded)
        else:
            found = layouts.read(folder, recorded.layout)
    except UserError as error:
        raise UserError(str(error).replace(f"{MANIFEST}:", f"{path}:")) from error
    recording = Recording([], [], {}, recorded.known_pose_error)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # touches that are not finite are skipped
        _sort(folder, found, recording)
    if not recording.touches:
        skipped = list(recording.skipped.items())
        reasons = "".join(f"\n  {name}: {reason}" for name, reason in skipped[:MOST_REASONS])
        reasons += f"\n  and {len(skipped) - MOST_REASONS} more" if len(skipped) > MOST_REASONS else ""
        raise UserError(f"{folder}: not one touch could be used{reasons or ': it holds none'}")
    return recording


def _sort(folder: Path, found: Iterator[tuple[str, Touch | str]], recording: Recording) -> None:
    """Add each touch, or the reason why it is unusable, to the recording.

    Raises:
        UserError: there are too many touches or points.
    """
    points = 0
    for number, (name, touch) in enumerate(found):
        points += len(touch.points) if isinstance(touch, Touch) else 0
        if number >= MOST_TOUCHES or points > MOST_TOUCHED_POINTS:
            raise UserError(
                f"{folder} holds more than {MOST_TOUCHES} touches or {MOST_TOUCHED_POINTS} touched points, the limits "
                f"of one recording: remove some"
            )
        if isinstance(touch, Touch) and not (np.isfinite(touch.points).all() and np.isfinite(touch.poses).all()):
            recording.skipped[name] = "its points or pose are not finite: a number in it is far too large or small"
        elif isinstance(touch, Touch):
            recording.touches.append(touch)
            recording.names.append(name)
        else:
            recording.skipped[name] = touch


def _unique_keys(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object as a dictionary, and refuse a key that occurs twice."""
    found = dict(pairs)
    if len(found) < len(pairs):
        key = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"'{key[:80]}' is written twice in one object: remove one of the two")
    return found


def _integer(digits: str) -> int:
    if len(digits) > 400:
        raise ValueError(f"a number of {len(digits)} digits")
    return int(digits)


def _json(path: Path) -> dict[str, Any]:
    try:
        data = read_bytes(path, most=LARGEST_JSON)
    except UserError as error:
        raise UserError(f"{error}: every recording has one") from error
    try:
        plain = json.loads(data.decode("utf-8-sig"), object_pairs_hook=_unique_keys, parse_int=_integer)
    except UnicodeDecodeError as error:
        raise UserError(f"{path} is not valid JSON: byte {error.start} is no UTF-8 text") from error
    except json.JSONDecodeError as error:
        place = f"line {error.lineno} column {error.colno}"
        raise UserError(f"{path} is not valid JSON: {place}: a comma, bracket or value is wrong") from error
    except ValueError as error:
        raise UserError(f"{path} is not valid JSON: {error}") from error
    except RecursionError as error:
        raise UserError(f"{path} is no manifest of touches: it is nested too deeply") from error
    if not isinstance(plain, dict):
        raise UserError(f"{path} holds a {type(plain).__name__}: it must be an object, {{…}}")
    return plain


def _manifest(plain: dict[str, Any]) -> RecordingManifest | LayoutManifest:
    if "layout" not in plain:
        return checked(RecordingManifest, plain, "")
    if "touches" in plain:
        raise UserError(f"{MANIFEST}: it has the keys touches and layout: remove one of them")
    return checked(LayoutManifest, plain, "")


def _listed(folder: Path, recorded: RecordingManifest) -> Iterator[tuple[str, Touch | str]]:
    """Yield the name of each touch of the manifest, with the touch or the reason why it is unusable."""
    if len(recorded.touches) > MOST_TOUCHES:
        raise UserError(f"{MANIFEST}: touches: it lists {len(recorded.touches)}, more than {MOST_TOUCHES}: remove some")
    taken: set[str] = set()
    for index, value in enumerate(recorded.touches):
        place = f"touches.{index}"
        name = _name(value) or place
        if name in taken:
            name = f"{name} ({place})"
        taken.add(name)
        try:
            yield name, _touch(folder, recorded, check_entry(value, place), place)
        except UserError as error:
            yield name, "; ".join(str(error).splitlines())
        except (ArithmeticError, MemoryError) as error:  # a number is far too large or small
            yield name, f"{place}: a number in it is too large or small: {error or type(error).__name__}"


def _name(value: Any) -> str | None:
    """Return the name of an entry, which may be invalid, or else its file."""
    if not isinstance(value, dict):
        return None
    for key in ("name", "cloud", "height", "depth"):
        if isinstance(value.get(key), str):
            return str(value[key])
    fingers = value.get("fingers")
    files = [_name(finger) for finger in fingers] if isinstance(fingers, list) else []
    return "+".join(file for file in files if file) or None


def _touch(folder: Path, recorded: RecordingManifest, entry: Entry | GraspEntry, place: str) -> Touch:
    if isinstance(entry, Entry):
        try:
            return _finger(folder, recorded, entry)
        except UserError as error:
            raise UserError(f"{MANIFEST}: {place}: {error}") from error
    fingers = []
    if len(entry.fingers) > MOST_FINGERS:
        raise UserError(
            f"{MANIFEST}: {place}.fingers: it lists {len(entry.fingers)}, more than {MOST_FINGERS}: remove some"
        )
    for number, value in enumerate(entry.fingers):
        inner = f"{place}.fingers.{number}"
        finger = check_entry(value, inner, in_grasp=True)
        fingers.append(_touch(folder, recorded, finger, inner))
    if len({len(finger.poses) for finger in fingers}) != 1:
        raise UserError(f"{MANIFEST}: {place}: some fingers have a pose and others none: give it for all, or for none")
    touch = Touch.grasp(fingers)
    if len(touch.points) == 0:
        raise UserError(f"{MANIFEST}: {place}: none of its fingers has any contact")
    if entry.order is not None:
        order = load_numpy(inside(folder, entry.order))
        whole = isinstance(order, np.ndarray) and order.ndim == 1 and order.dtype.kind in "iu"
        if not whole or not np.array_equal(np.sort(order), np.arange(len(touch.points))):
            raise UserError(
                f"{MANIFEST}: {place}.order: it must contain the index of each of the {len(touch.points)} points once"
            )
        touch = replace(touch, points=touch.points[order], finger=touch.finger[order])
    area = touch.contact_area if entry.contact_area is None else entry.contact_area
    return replace(touch, contact_area=area, sensor=entry.sensor or touch.sensor)


def _finger(folder: Path, recorded: RecordingManifest, entry: Entry) -> Touch:
    pose = None
    if entry.pose is not None:
        pose = sensor_to_object(entry.pose, recorded.unit, recorded.object_unit, recorded.object_pose)
    sensor = entry.sensor or recorded.sensor
    # The axes "-z" are pcsr's own. Multiplying by the identity could change the sign of a zero.
    sensor_pose = pose if pose is None or recorded.axes == "-z" else pose @ rotation_from(recorded.axes)
    if isinstance(entry, CloudEntry):
        points = np.zeros((0, 3)) if entry.cloud is None else read_points(inside(folder, entry.cloud))
        points = _in_object(points, entry.unit or recorded.unit, recorded, pose)
        _check_view(points, sensor_pose, entry.view)
        return Touch.single(points, sensor_pose, recorded.object_unit, sensor, entry.contact_area, entry.view)
    if sensor_pose is None:
        raise UserError("pose is missing: an image is in the frame of the sensor; add it")
    touched, area, view = _contact(folder, entry)
    return Touch.single(transformed(sensor_pose, touched), sensor_pose, recorded.object_unit, sensor, area, view)


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


def _contact(folder: Path, entry: Entry) -> tuple[Float[np.ndarray, "m 3"], float, tuple[float, float] | None]:
    """Return the contact points of an image, in pcsr's sensor frame, the contact area in mm², and the sensor's view.

    The view is None where the gel may be curved, as one with a background, or where a mask hides a part of it.
    """
    if isinstance(entry, HeightEntry):
        height = read_image(inside(folder, entry.height)) * entry.mm_per_level
        background = _optional(folder, entry.background, height, "background")
        mask = _optional(folder, entry.mask, height, "mask")
        height = height if background is None else height - background * entry.mm_per_level
        indentation = height if entry.indentation == "positive" else -height
        contact = (indentation > entry.contact_above) & (True if mask is None else mask != 0)
        flat = background is None and mask is None
        rows, columns = height.shape
        view = (columns * entry.mm_per_pixel, rows * entry.mm_per_pixel) if flat else None
        return *height_contact(indentation, entry.mm_per_pixel, contact), view
    assert isinstance(entry, DepthEntry)
    depth = read_image(inside(folder, entry.depth)) * entry.unit
    background = _optional(folder, entry.background, depth, "background")
    rest = entry.face if background is None else background * entry.unit
    contact = np.isfinite(rest) & (rest - depth > entry.contact_above)
    return *depth_contact(depth, entry.intrinsics, entry.face, contact), None


def _optional(folder: Path, name: str | None, image: np.ndarray, role: str) -> np.ndarray | None:
    other = None if name is None else read_image(inside(folder, name))
    same_size(image, other, role)
    return other
