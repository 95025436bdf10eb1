"""The layout `smith-2020`: grasps of 3D-Vision-and-Touch (Smith et al., 2020), one pickled file each.

The files of one object, `<grasp>.npy`, hold lists with one item for each finger: where its camera was, whether
it touched, and the surface that it felt, in the world's frame. The object is half as large there as in its own
frame, and 0.6 m up.
"""

import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.limits import MOST_TOUCHED_POINTS
from pcsr.recorded.manifest import Strict
from pcsr.recorded.pickles.unpickle import load_numpy
from pcsr.recorded.pose import in_object, turn
from pcsr.validation_messages import shown

METRE = 1000.0
SCALE = 0.5
"""Metres in the world for each unit of the object's own frame."""
LIFT = (0.0, 0.0, 0.6)
"""Where the origin of the object's own frame is in the world, in metres."""
KEYS = ("cam_pos", "cam_rot", "touch_success", "points")


class Options(Strict):
    """What the manifest says of this layout."""

    per: Literal["grasp", "finger"] = "grasp"
    """A touch is what all fingers of a grasp felt, or what one finger did."""


def read(folder: Path, options: Options) -> Iterator[tuple[str, Touch | str]]:
    """Each grasp or finger, in the object's own frame, whose unit is 500 mm.

    Raises:
        UserError: the folder holds no grasp.
    """
    files = in_order(path for path in folder.glob("*.npy") if path.is_file())
    if not files:
        raise UserError(f"{folder} holds no <grasp>.npy: give the folder of one object, scene_info/<class>/<object>")
    for path in files:
        yield from joined(path.stem, partial(_fingers, path), options.per)


def joined(name: str, fingers: Callable[[], Sequence[Touch | None]], per: str) -> Iterator[tuple[str, Touch | str]]:
    """A grasp as one touch or as one for each finger.

    Args:
        name: of the grasp.
        fingers: gives what each finger felt, None where it felt nothing; may refuse with a `UserError`.
        per: "grasp" or "finger".
    """
    try:
        felt = fingers()
    except UserError as error:
        yield name, str(error)
        return
    if per == "finger":
        for number, touch in enumerate(felt):
            yield f"{name}/{number}", touch or "this finger felt nothing"
        return
    touched = [touch for touch in felt if touch is not None]
    yield name, Touch.grasp(touched) if touched else f"none of its {len(felt)} fingers felt anything"


def in_order(paths: Iterable[Path]) -> list[Path]:
    """By name; numbers first, by their value."""

    def place(path: Path) -> tuple[float, str]:
        return float(path.stem) if path.stem.isdecimal() else np.inf, path.name

    return sorted(paths, key=place)


def numbers(value: Any, shape: tuple[int | None, ...], name: str, *, finite: bool = True) -> Float[np.ndarray, "..."]:
    """What a pickle holds, as numbers.

    Args:
        value: lists or an array.
        shape: that it must have; None in it: any length.
        name: for messages.
        finite: whether all must be.

    Raises:
        UserError: they are none, not finite, or of another shape.
    """
    _check_count(value, name)
    try:
        array = np.asarray(value)
    except (ValueError, OverflowError, TypeError) as error:  # lists of unequal length, or numbers that are none
        raise UserError(f"{name} holds no array of numbers: {textwrap.shorten(str(error), 100)}") from error
    if array.dtype.kind not in "biuf":
        raise UserError(f"{name} holds {array.dtype}, no numbers")
    if array.size == 0 and shape[0] is None:
        array = array.reshape(0, *(n or 0 for n in shape[1:]))
    fits = array.ndim == len(shape) and all(want in (None, n) for want, n in zip(shape, array.shape, strict=True))
    if not fits:
        wanted = ", ".join("n" if n is None else str(n) for n in shape)
        raise UserError(f"{name} must have shape ({wanted}), and has {array.shape}")
    if finite and not np.isfinite(array).all():
        raise UserError(f"{name}: {np.count_nonzero(~np.isfinite(array))} of {array.size} numbers are not finite")
    return array.astype(np.float64)


def _check_count(value: Any, name: str) -> None:
    """Refuse nested lists that are small in their file, as parts of them are one and the same, and endless in full."""
    counts: dict[int, int] = {}

    def count(one: Any) -> int:
        if not isinstance(one, list | tuple):
            return int(np.size(one)) if isinstance(one, np.ndarray) else 1
        if id(one) not in counts:
            counts[id(one)] = sum(map(count, one))
        return counts[id(one)]

    try:
        numbers = count(value)
    except RecursionError as error:
        raise UserError(f"{name} is nested too deeply") from error
    if numbers > MOST_TOUCHED_POINTS:
        raise UserError(f"{name} holds {numbers} numbers, and {MOST_TOUCHED_POINTS} are the most")


def _fingers(path: Path) -> list[Touch | None]:
    grasp = load_numpy(path)
    missing = [key for key in KEYS if key not in grasp] if isinstance(grasp, dict) else list(KEYS)
    if missing:
        raise UserError(f"{path} has no {', '.join(missing)}: it is no grasp of this layout")
    lists = [grasp[key] for key in KEYS]
    if not all(isinstance(one, list | tuple) or (isinstance(one, np.ndarray) and one.ndim) for one in lists):
        raise UserError(f"{path}: {', '.join(KEYS)} must be lists, one item for each finger")
    if len({len(one) for one in lists}) != 1:
        raise UserError(f"{path}: {', '.join(f'{len(one)} {key}' for key, one in zip(KEYS, lists, strict=True))}")
    return [
        _finger(place, angles, success, points, f"{path}: finger {number}")
        for number, (place, angles, success, points) in enumerate(zip(*lists, strict=True))
    ]


def _finger(place: Any, angles: Any, success: Any, points: Any, name: str) -> Touch | None:
    if not _truth(success, name):
        return None
    felt = numbers(points, (None, 3), f"{name}: points")
    if len(felt) == 0:
        return None
    rigid = np.eye(4)
    rigid[:3, :3] = Rotation.from_euler("xyz", numbers(angles, (3,), f"{name}: cam_rot")).as_matrix()
    rigid[:3, 3] = numbers(place, (3,), f"{name}: cam_pos") - LIFT
    pose = in_object(rigid, METRE, SCALE * METRE) @ turn("+x")
    return Touch.single((felt - LIFT) / SCALE, pose, SCALE * METRE, "smith-2020")


def _truth(value: Any, name: str) -> bool:
    flag = np.asarray(value) if isinstance(value, bool | int | float | np.generic | np.ndarray) else np.zeros(0)
    if flag.size != 1 or flag.dtype.kind not in "biuf":
        raise UserError(f"{name}: touch_success must be true or false, got {shown(value)}")
    return bool(flag.item())
