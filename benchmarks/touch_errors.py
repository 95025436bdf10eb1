"""The study of errors of touch: touches as reported and registered, over the draws of the errors."""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from touch_studies import (
    CAMERA,
    CAMERAS,
    DEPTH,
    ERRORS,
    PLAIN,
    POLICY,
    POSITION,
    REGISTRATION,
    ROTATION,
    SAMPLING,
    SHARED_POSITION,
    SHARED_ROTATION,
    Numbers,
    Row,
)

from pcsr.report.figures.line_chart import Line

CLOUD = (SAMPLING, CAMERAS, CAMERA, POLICY)
WORSE = 0.01
"""A part is worse with touch if its error is greater than without by more than this share."""
HEADS = ("cloud", "error of each touch, mm / °", "shared error, mm / °", "depth noise, mm", "coverage")
REPORTED, REGISTERED = "as reported", "registered"


@dataclass(frozen=True)
class Draws:
    """Rows that differ in the seed of the data alone: several draws of the same errors."""

    rows: tuple[Row, ...]

    def per_object(self, values: Sequence[Numbers]) -> Numbers:
        """Return the mean of each object over its draws, from one array for each row."""
        of_object: dict[str, list[float]] = defaultdict(list)
        for row, some in zip(self.rows, values, strict=True):
            for name, value in zip(row.objects, some.tolist(), strict=True):
                of_object[name].append(value)
        return np.array([np.mean(some) for some in of_object.values()])

    @property
    def plain(self) -> float:
        """Error without touch."""
        return float(self.per_object([row.plain for row in self.rows]).mean())

    @property
    def changes(self) -> Numbers:
        """What touch changes for each object, mean over draws; below 0 it helps."""
        return self.per_object([row.touched - row.plain for row in self.rows])

    @property
    def change(self) -> float:
        """Mean of `changes`."""
        return float(self.changes.mean())

    @property
    def error(self) -> float:
        """Standard error of `change` over objects; draws of one object are not independent. NaN for one object."""
        changes = self.changes
        return float(changes.std(ddof=1)) / math.sqrt(len(changes)) if len(changes) > 1 else math.nan

    @property
    def worse(self) -> int:
        """Number of objects and draws with an error that is greater than without touch by more than `WORSE`."""
        return sum(int((row.touched > (1 + WORSE) * row.plain).sum()) for row in self.rows)

    @property
    def count(self) -> int:
        """Number of objects, of all draws."""
        return sum(len(row.objects) for row in self.rows)

    @property
    def coverage(self) -> float:
        """Mean of the rows' coverage."""
        return float(np.mean([row.coverage for row in self.rows]))


@dataclass(frozen=True)
class Setting:
    """Errors of the sensor and the arm on one kind of cloud."""

    settings: dict[str, Any]
    reported: Draws | None
    registered: Draws | None

    @property
    def shown(self) -> Draws:
        """The reported touches, or the registered ones if the reported were not measured."""
        draws = self.reported or self.registered
        assert draws
        return draws


def settings_of(rows: Sequence[Row]) -> list[Setting]:
    """Group the rows of the study by their settings, in the order of the rows; the draws of a setting are its seeds."""
    keys = (*CLOUD, *ERRORS, DEPTH)
    found: dict[tuple[Any, ...], dict[bool, list[Row]]] = defaultdict(lambda: defaultdict(list))
    for row in rows:
        found[tuple(row.settings[key] for key in keys)][row.settings[REGISTRATION]].append(row)
    draws = [{key: Draws(tuple(some)) for key, some in one.items()} for one in found.values()]
    return [
        Setting(dict(zip(keys, values, strict=True)), one.get(False), one.get(True))
        for values, one in zip(found, draws, strict=True)
    ]


def arm_settings(rows: Sequence[Row]) -> list[Setting]:
    """Return the settings with registered touches: those of the arm's errors."""
    return [one for one in settings_of(rows) if one.registered]


def cells_of(settings: Sequence[Setting]) -> tuple[list[str], list[list[str]]]:
    """Return the heads and the cells of the table, a line for each setting."""
    label = settings[0].shown.rows[0].label
    heads = [*HEADS, f"{label} {PLAIN}", f"change, {REPORTED}", f"change, {REGISTERED}"]
    heads += ["gain kept", f"worse by over {WORSE:.0%}", "parts × draws"]
    return heads, [_cells(one, _exact(one, settings)) for one in settings]


def _cells(one: Setting, exact: Setting | None) -> list[str]:
    of, registered, kept, draws = one.settings, one.registered, "", len(one.shown.rows)
    if registered and exact and exact.reported and exact.reported.change < 0:
        kept = f"{registered.change / exact.reported.change:.0%}"
    coverage = [f"{some.coverage:.1%}" for some in (one.reported, registered) if some]
    return [
        _cloud(of),
        f"{of[POSITION]:g} / {of[ROTATION]:g}",
        f"{of[SHARED_POSITION]:g} / {of[SHARED_ROTATION]:g}",
        f"{of[DEPTH]:g}",
        " → ".join(coverage),
        f"{one.shown.plain:.3f}",
        *map(_change, (one.reported, registered)),
        kept,
        f"{registered.worse}/{registered.count}" if registered else "",
        f"{one.shown.count} ({draws} draw{'s' if draws > 1 else ''})",
    ]


def _change(draws: Draws | None) -> str:
    if draws is None:
        return ""
    return f"{draws.change:+.3f} ± {draws.error:.3f} ({draws.change / draws.plain:+.1%})"


def _cloud(of: dict[str, Any]) -> str:
    cameras = f"{of[CAMERAS]} camera{'' if of[CAMERAS] == 1 else 's'}"
    cloud = cameras if of[SAMPLING] == "view" else "random points"
    noise = f", noise {of[CAMERA]:g}" if of[CAMERA] else ""
    policy = "" if of[POLICY] == "uniform" else f", touches {of[POLICY]}"
    return f"{cloud}{noise}{policy}"


def _exact(one: Setting, settings: Sequence[Setting]) -> Setting | None:
    """Return the setting of an exact arm on the same cloud with the same sensor."""
    same = [other for other in settings if all(other.settings[key] == one.settings[key] for key in (*CLOUD, DEPTH))]
    return next((other for other in same if not any(other.settings[key] for key in ERRORS)), None)


def over_error(settings: Sequence[Setting]) -> tuple[list[str], dict[str, Line]]:
    """Return the arm's errors, on the cloud and with the sensor of most settings, and the lines over them."""
    private = [one for one in settings if not (one.settings[SHARED_POSITION] or one.settings[SHARED_ROTATION])]
    kinds = [tuple(one.settings[key] for key in (*CLOUD, DEPTH)) for one in private]
    most = max(kinds, key=kinds.count, default=())
    some = [one for one, kind in zip(private, kinds, strict=True) if kind == most]
    some.sort(key=lambda one: (one.settings[POSITION], one.settings[ROTATION]))
    lines: dict[str, Line] = {PLAIN: ([one.shown.plain for one in some], None)}
    for name, draws in ((REPORTED, [one.reported for one in some]), (REGISTERED, [one.registered for one in some])):
        if any(draws):
            means = [of.plain + of.change if of else math.nan for of in draws]
            lines[name] = (means, [of.error if of else math.nan for of in draws])
    return [f"{one.settings[POSITION]:g} / {one.settings[ROTATION]:g}" for one in some], lines
