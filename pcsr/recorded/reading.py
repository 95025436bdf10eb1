"""Reading a recording: its manifest, its files, each touch in the object's frame; what is wrong with the others."""

import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.clouds.formats import read_points
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
    Recorded,
    check_entry,
    checked,
)
from pcsr.recorded.pickles.unpickle import load_numpy
from pcsr.recorded.pose import rotation_from, sensor_to_object, transformed

MANIFEST = "touches.json"
REASONS = 20
"""The most unusable touches whose reasons a message lists, where no touch is usable."""


@dataclass(frozen=True)
class Recording:
    """The touches of one object, in its frame and unit."""

    touches: list[Touch]
    names: list[str]
    """Of each touch: its name, or its file."""
    skipped: dict[str, str]
    """What was left out, and why."""


def read(folder: Path | str) -> Recording:
    """Read a recording. A touch that cannot be used is left out, with the reason; the others are not the worse.

    Raises:
        UserError: the manifest is not there or has mistakes, or not one touch is of use; all the reasons.
    """
    folder = Path(folder)
    folder = folder.parent if folder.name == MANIFEST else folder
    path = folder / MANIFEST
    plain = _json(path)
    recording = Recording([], [], {})
    try:
        found = _laid_out(folder, plain) if "layout" in plain else _listed(folder, checked(Recorded, plain, ""))
    except UserError as error:
        raise UserError(str(error).replace(f"{MANIFEST}:", f"{path}:")) from error
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # what is not finite is left out
        _sort(folder, found, recording)
    if not recording.touches:
        skipped = list(recording.skipped.items())
        reasons = "".join(f"\n  {name}: {reason}" for name, reason in skipped[:REASONS])
        reasons += f"\n  and {len(skipped) - REASONS} more" if len(skipped) > REASONS else ""
        raise UserError(f"{folder}: not one touch could be used{reasons or ': there is none in it'}")
    return recording


def _sort(folder: Path, found: Iterator[tuple[str, Touch | str]], recording: Recording) -> None:
    """Put each touch into the recording, or the reason why it is of no use.

    Raises:
        UserError: they are too many.
    """
    points = 0
    for number, (name, touch) in enumerate(found):
        points += len(touch.points) if isinstance(touch, Touch) else 0
        if number >= MOST_TOUCHES or points > MOST_TOUCHED_POINTS:
            raise UserError(
                f"{folder} holds more than {MOST_TOUCHES} touches or {MOST_TOUCHED_POINTS} touched points, the most of "
                f"one recording: leave some out"
            )
        if isinstance(touch, Touch) and not (np.isfinite(touch.points).all() and np.isfinite(touch.poses).all()):
            recording.skipped[name] = (
                "its points or pose are not finite numbers: a figure in it is far too large or small"
            )
        elif isinstance(touch, Touch):
            recording.touches.append(touch)
            recording.names.append(name)
        else:
            recording.skipped[name] = touch


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """A JSON object, in which each key stands once."""
    found = dict(pairs)
    if len(found) < len(pairs):
        key = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ValueError(f"'{key[:80]}' is written twice in one object: remove one of the two")
    return found


def _whole(digits: str) -> int:
    if len(digits) > 400:
        raise ValueError(f"a number of {len(digits)} digits")
    return int(digits)


def _json(path: Path) -> dict[str, Any]:
    try:
        data = read_bytes(path, most=LARGEST_JSON)
    except UserError as error:
        raise UserError(f"{error}: a recording has one") from error
    try:
        plain = json.loads(data.decode("utf-8-sig"), object_pairs_hook=_once, parse_int=_whole)
    except ValueError as error:
        raise UserError(f"{path} is no JSON: {error}") from error
    except RecursionError as error:
        raise UserError(f"{path} is no JSON of touches: it is nested too deeply") from error
    if not isinstance(plain, dict):
        raise UserError(f"{path} holds a {type(plain).__name__}: it must be an object, {{…}}")
    return plain


def _laid_out(folder: Path, plain: dict[str, Any]) -> Iterator[tuple[str, Touch | str]]:
    if "touches" in plain:
        raise UserError(f"{MANIFEST}: it says touches and layout: say which of them it is")
    return layouts.read(folder, checked(LayoutManifest, plain, "").layout)


def _listed(folder: Path, recorded: Recorded) -> Iterator[tuple[str, Touch | str]]:
    """The touches of the manifest, or what is wrong with them."""
    if len(recorded.touches) > MOST_TOUCHES:
        raise UserError(f"{MANIFEST}: touches: it has {len(recorded.touches)}, and {MOST_TOUCHES} are the most")
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
        except (ArithmeticError, MemoryError) as error:  # a figure that is far too large or small
            yield name, f"{place}: it cannot be computed with: {error or type(error).__name__}"


def _name(value: Any) -> str | None:
    """What to call an entry, be it right or wrong: its name, or its file."""
    if not isinstance(value, dict):
        return None
    for key in ("name", "cloud", "height", "depth"):
        if isinstance(value.get(key), str):
            return str(value[key])
    fingers = value.get("fingers")
    files = [_name(finger) for finger in fingers] if isinstance(fingers, list) else []
    return "+".join(file for file in files if file) or None


def _touch(folder: Path, recorded: Recorded, entry: Entry | GraspEntry, place: str) -> Touch:
    if isinstance(entry, Entry):
        try:
            return _finger(folder, recorded, entry)
        except UserError as error:
            raise UserError(f"{MANIFEST}: {place}: {error}") from error
    fingers = []
    if len(entry.fingers) > MOST_FINGERS:
        raise UserError(f"{MANIFEST}: {place}.fingers: it has {len(entry.fingers)}, and {MOST_FINGERS} are the most")
    for number, value in enumerate(entry.fingers):
        inner = f"{place}.fingers.{number}"
        finger = check_entry(value, inner, in_grasp=True)
        fingers.append(_touch(folder, recorded, finger, inner))
    if len({len(finger.poses) for finger in fingers}) != 1:
        raise UserError(f"{MANIFEST}: {place}: some fingers have a pose and others none: give all of them one, or none")
    touch = Touch.grasp(fingers)
    if len(touch.points) == 0:
        raise UserError(f"{MANIFEST}: {place}: none of its fingers felt anything")
    if entry.order is not None:
        order = load_numpy(inside(folder, entry.order))
        whole = isinstance(order, np.ndarray) and order.ndim == 1 and order.dtype.kind in "iu"
        if not whole or not np.array_equal(np.sort(order), np.arange(len(touch.points))):
            raise UserError(f"{MANIFEST}: {place}.order: it does not name each of the {len(touch.points)} points once")
        touch = replace(touch, points=touch.points[order], finger=touch.finger[order])
    area = touch.contact_area if entry.contact_area is None else entry.contact_area
    return replace(touch, contact_area=area, sensor=entry.sensor or touch.sensor)


def _finger(folder: Path, recorded: Recorded, entry: Entry) -> Touch:
    pose = None
    if entry.pose is not None:
        pose = sensor_to_object(entry.pose, recorded.unit, recorded.object_unit, recorded.object_pose)
    sensor = entry.sensor or recorded.sensor
    # Multiplying by a turn that turns nothing would leave the numbers, but not the sign of each 0.
    ours = pose if pose is None or recorded.axes == "-z" else pose @ rotation_from(recorded.axes)
    if isinstance(entry, CloudEntry):
        points = np.zeros((0, 3)) if entry.cloud is None else read_points(inside(folder, entry.cloud))
        points = _in_object(points, entry.unit or recorded.unit, recorded, pose)
        return Touch.single(points, ours, recorded.object_unit, sensor, entry.contact_area)
    if ours is None:
        raise UserError("pose is missing: where the sensor was must be known to place what it saw; add it")
    touched, area = _seen(folder, entry)
    return Touch.single(transformed(ours, touched), ours, recorded.object_unit, sensor, area)


def _in_object(
    points: Float[np.ndarray, "n 3"], unit: float, recorded: Recorded, pose: Float[np.ndarray, "4 4"] | None
) -> Float[np.ndarray, "n 3"]:
    if recorded.frame == "object":
        return points if unit == recorded.object_unit else points * (unit / recorded.object_unit)
    if pose is None:
        raise UserError("pose is missing: the cloud is in the sensor's frame; add it")
    return transformed(pose, points * unit)


def _seen(folder: Path, entry: Entry) -> tuple[Float[np.ndarray, "m 3"], float]:
    """What an image shows, in pcsr's sensor frame, and the area of the contact."""
    if isinstance(entry, HeightEntry):
        height = read_image(inside(folder, entry.height)) * entry.mm_per_level
        background = _optional(folder, entry.background, height, "background")
        mask = _optional(folder, entry.mask, height, "mask")
        height = height if background is None else height - background * entry.mm_per_level
        indentation = height if entry.indentation == "positive" else -height
        contact = (indentation > entry.contact_above) & (True if mask is None else mask != 0)
        return height_contact(indentation, entry.mm_per_pixel, contact)
    assert isinstance(entry, DepthEntry)
    depth = read_image(inside(folder, entry.depth)) * entry.unit
    background = _optional(folder, entry.background, depth, "background")
    rest = entry.face if background is None else background * entry.unit
    contact = np.isfinite(rest) & (rest - depth > entry.contact_above)
    return depth_contact(depth, entry.intrinsics, entry.face, contact)


def _optional(folder: Path, name: str | None, image: np.ndarray, what: str) -> np.ndarray | None:
    other = None if name is None else read_image(inside(folder, name))
    same_size(image, other, what)
    return other
