"""Reading of recordings: the manifest, the data files, and each touch converted to the object's frame."""

import json
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.files import inside
from pcsr.inputs import read_bytes
from pcsr.limits import LARGEST_JSON, MOST_FINGERS, MOST_TOUCHED_POINTS, MOST_TOUCHES
from pcsr.recorded import layouts
from pcsr.recorded.fingers import finger_touch
from pcsr.recorded.manifest import (
    Entry,
    GraspEntry,
    LayoutManifest,
    RecordingManifest,
    check_entry,
    checked,
)
from pcsr.recorded.other_files import check_is_recording
from pcsr.recorded.pickles.unpickle import load_numpy

MANIFEST = "touches.json"
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
    if not os.path.exists(path):  # which knows no errors, unlike that of a path
        check_is_recording(folder, MANIFEST)
    plain = _json(path)
    try:
        recorded = _manifest(plain)
        pose_error = recorded.known_pose_error
        if isinstance(recorded, RecordingManifest):
            found = _listed(folder, recorded)
        else:
            options = layouts.options(recorded.layout)
            found, pose_error = layouts.read(folder, options), pose_error or options.known_pose_error
    except UserError as error:
        raise UserError(str(error).replace(f"{MANIFEST}:", f"{path}:")) from error
    recording = Recording([], [], {}, pose_error)
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
    for key in ("name", "cloud", "height", "depth", "image"):
        if isinstance(value.get(key), str):
            return str(value[key])
    fingers = value.get("fingers")
    files = [_name(finger) for finger in fingers] if isinstance(fingers, list) else []
    return "+".join(file for file in files if file) or None


def _touch(folder: Path, recorded: RecordingManifest, entry: Entry | GraspEntry, place: str) -> Touch:
    if isinstance(entry, Entry):
        try:
            return finger_touch(folder, recorded, entry)
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
        touch = touch.subset(order)
    area = touch.contact_area if entry.contact_area is None else entry.contact_area
    return replace(touch, contact_area=area, sensor=entry.sensor or touch.sensor)
