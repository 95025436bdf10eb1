"""What layouts of pickled arrays share: numbers checked, files in order, and the fingers of a grasp joined."""

import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.limits import MOST_TOUCHED_POINTS

METRE = 1000.0
"""A metre in millimetres."""


def joined(name: str, fingers: Callable[[], Sequence[Touch | None]], per: str) -> Iterator[tuple[str, Touch | str]]:
    """A grasp as one touch or as one for each finger.

    Args:
        name: of the grasp.
        fingers: gives the touch of each finger, None where it touched nothing; may refuse with a `UserError`.
        per: "grasp" or "finger".
    """
    try:
        gathered = fingers()
    except UserError as error:
        yield name, str(error)
        return
    if per == "finger":
        for number, touch in enumerate(gathered):
            yield f"{name}/{number}", touch or "this finger felt nothing"
        return
    touched = [touch for touch in gathered if touch is not None]
    yield name, Touch.grasp(touched) if touched else f"none of its {len(gathered)} fingers felt anything"


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
