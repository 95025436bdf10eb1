"""Helpers of the layouts with pickled arrays: numbers are checked, files sorted, fingers joined to grasps."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.limits import MOST_TOUCHED_POINTS

METRE = 1000.0
"""Length of a metre in mm."""


def joined(name: str, fingers: Callable[[], Sequence[Touch | None]], per: str) -> Iterator[tuple[str, Touch | str]]:
    """Yield a grasp as one touch, or as one touch for each finger; instead of an unusable one, the reason.

    Args:
        name: name of the grasp.
        fingers: returns the touch of each finger, or None for a finger without contact. May raise a `UserError`.
        per: `"grasp"` or `"finger"`.
    """
    try:
        gathered = fingers()
    except UserError as error:
        yield name, str(error)
        return
    if per == "finger":
        for number, touch in enumerate(gathered):
            yield f"{name}/{number}", touch or "this finger has no contact"
        return
    touched = [touch for touch in gathered if touch is not None]
    yield name, Touch.grasp(touched) if touched else f"none of its {len(gathered)} fingers has any contact"


def in_order(paths: Iterable[Path]) -> list[Path]:
    """Sort files by name; numbers come first, by their value."""

    def key(path: Path) -> tuple[float, str]:
        return float(path.stem) if path.stem.isdecimal() else np.inf, path.name

    return sorted(paths, key=key)


def numbers(value: Any, shape: tuple[int | None, ...], name: str, *, finite: bool = True) -> Float[np.ndarray, "..."]:
    """Convert a value from a pickle to an array of doubles.

    Args:
        value: nested lists or an array.
        shape: expected shape, where None stands for any length.
        name: name of the value, for messages.
        finite: refuse numbers that are not finite.

    Raises:
        UserError: the value is not numeric, has another shape, or holds numbers that are not finite.
    """
    _check_count(value, name)
    try:
        array = np.asarray(value)
    except (ValueError, OverflowError, TypeError) as error:  # lists of unequal length, or items that are not numbers
        raise UserError(
            f"{name} holds no array of numbers: its lists differ in length, or hold other things"
        ) from error
    if array.dtype.kind not in "biuf":
        raise UserError(f"{name} holds {array.dtype}, not numbers")
    if array.size == 0 and shape[0] is None:
        array = array.reshape(0, *(n or 0 for n in shape[1:]))
    fits = array.ndim == len(shape) and all(want in (None, n) for want, n in zip(shape, array.shape, strict=True))
    if not fits:
        wanted = ", ".join("n" if n is None else str(n) for n in shape)
        raise UserError(f"{name} must have shape ({wanted}), got {array.shape}")
    if finite and not np.isfinite(array).all():
        raise UserError(f"{name}: {np.count_nonzero(~np.isfinite(array))} of {array.size} numbers are not finite")
    return array.astype(np.float64)


def _check_count(value: Any, name: str) -> None:
    """Refuse nested lists that repeat the same inner lists, so that a small file would expand to a huge array."""
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
        raise UserError(f"{name} holds {numbers} numbers, more than {MOST_TOUCHED_POINTS}")
