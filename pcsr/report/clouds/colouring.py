"""Colours of clouds by a column: red, green and blue, a scale of numbers, or classes such as labels."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import COLOURS, SHORT_COLOURS, spread
from pcsr.errors import UserError, did_you_mean
from pcsr.report.clouds.extent import ends
from pcsr.report.colours import CLASSES, INPUT, TOUCH, TRUTH

MOST_CLASSES = len(CLASSES)
"""Largest number of different whole numbers in a column that are shown as classes; more are shown on a scale."""
SOURCE = "source"
"""Name of the column that says where a point comes from: 0, 1 or 2, an index into `SOURCES`."""
NUMBERED_SOURCE = re.compile(r"source(?:_(\d+))?", re.IGNORECASE)
"""Names of such columns of a cloud that was upsampled several times: `source`, `source_2`, …"""
SOURCES = ("old", "new", "touched")
SOURCE_COLOURS = (TRUTH, INPUT, TOUCH)
AXES = ("x", "y", "z")
RGB, NONE = "rgb", "none"
"""Values of `--color` that are not names of columns."""


@dataclass(frozen=True)
class Scale:
    """Numbers on a scale of colours."""

    name: str
    low: float
    high: float


@dataclass(frozen=True)
class Classes:
    """Classes of points, each with a label and a colour, ``#rrggbb``."""

    name: str
    labels: Sequence[str]
    colours: Sequence[str]


@dataclass(frozen=True)
class Colours:
    """Colours of several clouds, on one scale or with the same classes."""

    key: Scale | Classes | None
    """None: the clouds have colours of their own, or all points have the same one."""
    clouds: Sequence[np.ndarray | None]
    """For each cloud a row for each point: a number (NaN: none) with a `Scale`; the index of a class with `Classes`;
    otherwise red, green and blue, 0 to 255. None: the cloud has no such column."""


def colours_of(clouds: Sequence[Cloud], by: str | None = None) -> Colours:
    """Return the colours of clouds by a column.

    Whole numbers of at most `MOST_CLASSES` different values are classes, whatever their type.

    Args:
        clouds: clouds, some of which may lack the column.
        by: name of a column; x, y or z; "rgb" for the colours; "none" for one colour. By default the column `source`
            if a cloud has it (of `source`, `source_2` … the last), else the colours if a cloud has any, else z.

    Raises:
        UserError: no cloud has the column.
    """
    flat = [spread(cloud.columns, rest=True) for cloud in clouds]
    if by is None:
        sources = [source_column(columns) for columns in flat]
        if any(column is not None for column in sources):
            return _numbers(SOURCE, sources)
        # Many scanners write colours that are all black.
        colours = [one if one is not None and one.any() else None for one in map(_rgb, flat)]
        if any(one is not None for one in colours):
            return Colours(None, colours)
        return _numbers("z", [cloud.points[:, 2] for cloud in clouds], scale=True)
    if by.lower() == NONE:
        return Colours(None, [None] * len(clouds))
    if by.lower() in AXES:
        return _numbers(by, [cloud.points[:, AXES.index(by.lower())] for cloud in clouds], scale=True)
    named = [_number_column(columns, by) for columns in flat]
    if any(column is not None for column in named):
        return _numbers(by, named)
    if by.lower() == RGB:
        colours = [_rgb(columns) for columns in flat]
        if any(one is not None for one in colours):
            return Colours(None, colours)
    known = {name for columns in flat for name in columns} | {*AXES, NONE}
    known |= {RGB} if any(_rgb(columns) is not None for columns in flat) else set()
    raise UserError(f"--color {by}: no cloud has such a column: {did_you_mean(by, known)}")


def _numbers(name: str, columns: Sequence[np.ndarray | None], *, scale: bool = False) -> Colours:
    """Colours by a column of numbers, on a scale if it is asked for, or else as classes where these are few."""
    values = [None if column is None else _finite(column) for column in columns]
    everything = np.concatenate([one[np.isfinite(one)] for one in values if one is not None])
    different = np.unique(everything)
    whole = (different == np.rint(different)).all()
    if scale or not (whole and len(different) <= MOST_CLASSES):
        low, high = ends(everything[:, None])
        return Colours(Scale(name, float(low[0]), float(high[0])), values)
    if NUMBERED_SOURCE.fullmatch(name) and np.isin(different, (0, 1, 2)).all():
        different = np.arange(3.0)
        classes = Classes(SOURCE, SOURCES, SOURCE_COLOURS)
    else:
        classes = Classes(name, [f"{value:.0f}" for value in different], CLASSES[: len(different)])
    return Colours(classes, [None if one is None else _codes(one, different) for one in values])


def _codes(values: Float[np.ndarray, " n"], different: Float[np.ndarray, " k"]) -> Int[np.ndarray, " n"]:
    """Index of each value among the different ones; -1 where there is no value."""
    codes = np.searchsorted(different, np.where(np.isfinite(values), values, different[:1].sum()))
    return np.where(np.isfinite(values), codes, -1)


def _finite(column: np.ndarray) -> Float[np.ndarray, " n"]:
    """A column as doubles, NaN where it is not finite."""
    with np.errstate(invalid="ignore"):  # of signalling NaN
        values = column.astype(np.float64)
    return np.where(np.isfinite(values), values, np.nan)


def source_column(columns: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Return the column that says where a point comes from, the last one of several; None if there is none."""
    found = {
        int(match[1] or 1): column
        for name, column in columns.items()
        if (match := NUMBERED_SOURCE.fullmatch(name)) and np.isin(column, (0, 1, 2)).all()
    }
    return found[max(found)] if found else None


def _number_column(columns: Mapping[str, np.ndarray], name: str) -> np.ndarray | None:
    """The column of a name, else the first whose name differs in case alone."""
    alike = [one for one in columns if one.lower() == name.lower()]
    return columns[name if name in columns else alike[0]] if alike else None


def _rgb(columns: Mapping[str, np.ndarray]) -> UInt8[np.ndarray, "n 3"] | None:
    """Colours, 0 to 255, from columns of 8 or 16 bits, or of fractions; None if there are none."""
    for names in (COLOURS[:3], SHORT_COLOURS):
        found = [_number_column(columns, name) for name in names]
        parts = [part for part in found if part is not None]
        if len(parts) < 3:
            continue
        values = np.nan_to_num(np.stack([_finite(part) for part in parts], axis=1), nan=0.0).clip(0)
        highest = values.max(initial=0.0)
        fractions = all(part.dtype.kind in "fb" for part in parts) and highest <= 1
        scale = 255.0 if fractions else 1.0 if highest <= 255 else 255.0 / 65535.0
        return np.asarray(np.rint(values * scale).clip(0, 255), np.uint8)
    return None
