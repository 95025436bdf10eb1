"""The pictures of docs/when-touch-helps.md, from the rows of its studies."""

import math
from collections import defaultdict
from collections.abc import Callable, Sequence
from itertools import pairwise
from pathlib import Path

from touch_errors import over_error, settings_of
from touch_studies import BESIDE, CAMERA, NETWORK, PLAIN, POLICY, SIZE, TOUCHES, Row, around, own

from pcsr.report.figures.line_chart import Line, line_chart
from pcsr.report.tables.scores import scaled

BAND = "band: ± standard error of what touch changes"
Curves = tuple[Sequence[float | str], dict[str, Line]]
"""What is along x, and the lines over it."""


def over_touches(rows: Sequence[Row], name: Callable[[Row], str]) -> Curves:
    """A line for each name, from no touch on."""
    numbers = sorted({0, *(row.touches for row in rows)})
    lines: dict[str, Line] = {}
    for label in dict.fromkeys(map(name, rows)):
        of_label = {row.touches: row for row in rows if name(row) == label}
        means = [of_label[k].touched.mean() if k in of_label else math.nan for k in numbers]
        means[0] = next(iter(of_label.values())).plain.mean()
        lines[label] = (means, [of_label[k].error if k in of_label else math.nan for k in numbers])
    return numbers, lines


def over_setting(rows: Sequence[Row], key: str, prefix: str = "") -> Curves:
    """A line without touch and one with, over a setting; and the baselines."""
    x = [row.settings[key] for row in rows]
    lines: dict[str, Line] = {f"{prefix}{PLAIN}": ([row.plain.mean() for row in rows], None)}
    lines[f"{prefix}{TOUCHES} touches"] = ([row.touched.mean() for row in rows], [row.error for row in rows])
    for name in BESIDE:
        if any(name in row.beside for row in rows):
            lines[name] = ([row.beside.get(name, math.nan) for row in rows], None)
    return x, lines


def by_distance(row: Row) -> Curves:
    """Squared error of the truth's points over their distance to the nearest touched one."""
    edges = row.effect.edges
    x = [f"{low:g} to {high:g}" for low, high in pairwise(edges)] + [f"from {edges[-1]:g}"]
    names = {f"{row.name} {PLAIN}": PLAIN, row.name: f"{row.touches} touches"} | dict(zip(BESIDE, BESIDE, strict=True))
    errors = {label: row.effect.errors[name] for name, label in names.items() if name in row.effect.errors}
    return x, {
        label: ([math.nan if one is None else row.scale * one for one in of], None) for label, of in errors.items()
    }


def draw(studies: dict[str, list[Row]], folder: Path) -> list[Path]:
    """A picture for each study, `when-STUDY.png`; of `size` also one of the networks and one over the distance."""
    made: list[Path] = []

    def chart(name: str, title: str, x_label: str, curves: Curves, y_label: str) -> None:
        made.append(folder / f"when-{name}.png")
        line_chart(title, x_label, y_label, *curves, made[-1])

    if "size" in studies:
        _draw_sizes(studies["size"], chart)
    if rows := studies.get("vision"):
        x_label = "standard deviation, radii of the object"
        chart("vision", f"Noise of the cameras; {BAND}", x_label, over_setting(rows, CAMERA), rows[0].label)
    for study, where in (("occlusion", "one side seen"), ("policy", "random points")):
        if rows := studies.get(study):
            title = f"Where to touch, {where}; {BAND}"
            chart(study, title, "touches", over_touches(rows, lambda row: row.settings[POLICY]), rows[0].label)
    if rows := studies.get("sensor"):
        title = f"Error of the arm, {TOUCHES} touches; {BAND}"
        x_label = "standard deviation along / about each axis, mm / degrees"
        chart("sensor", title, x_label, over_error(settings_of(rows)), rows[0].label)
    return made


def _draw_sizes(rows: Sequence[Row], chart: Callable[[str, str, str, Curves, str], None]) -> None:
    of_network: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        of_network[row.settings[NETWORK]].append(row)
    curves = over_touches(own(rows), lambda row: f"{row.settings[SIZE]:g} mm")
    chart("size", f"Size of the object; {BAND}", "touches", curves, rows[0].label)

    at = {name: [row for row in some if row.touches == TOUCHES] for name, some in of_network.items()}
    sizes = sorted({row.settings[SIZE] for some in at.values() for row in some})
    lines: dict[str, Line] = {}
    for name, some in at.items():
        if [row.settings[SIZE] for row in some] == sizes:
            found = over_setting(some, SIZE, f"{name}, ")[1]
            lines |= {label: line for label, line in found.items() if label not in BESIDE}
    if sizes and lines:
        named: Curves = [f"{size:g} mm" for size in sizes], lines
        chart("networks", f"Networks; {BAND}", "longest side of the object", named, rows[0].label)
    if nearest := around(rows):
        title = f"Error around the touches of parts of {nearest.settings[SIZE]:g} mm"
        x_label = "from a true point to the nearest touched one, radii of the object"
        y_label = scaled("squared distance to the nearest point", nearest.scale)
        chart("distance", title, x_label, by_distance(nearest), y_label)
