"""The figures of the paper from run folders: touches (Fig. 4), close-ups (Fig. 5), networks side by side (Fig. 6)."""

import math
import string
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from pcsr.report import chart
from pcsr.report.comparison import VARIED, varied
from pcsr.report.gather import Gathered, Subject, gather
from pcsr.report.lettering import INK, rgb
from pcsr.report.pictures import Camera, Layer, camera, disc_radius, error_colours, picture
from pcsr.report.results import Cloud
from pcsr.report.rows import variants
from pcsr.report.scores import scaled
from pcsr.report.sheet import Panel, sheet
from pcsr.report.views import ERROR_SCALE, distance, scale_end

INPUT, TOUCH, TRUTH = (np.array(rgb(colour)) / 255 for colour in ("#1f6fb2", "#d0202b", "#4a5560"))
"""As on the report's page in a bright room."""
SIZE, CLOSE = 340, 240
"""Pixels along a picture; along one of a pair of whole and close-up."""
OBJECTS = 3
"""In the figures of several objects, as the paper has it."""
ZOOM = 3.0
COLUMNS = 4


def figures(folders: Sequence[Path]) -> dict[str, Image.Image]:
    """Draw every figure that the runs have the clouds or numbers for.

    Args:
        folders: of runs on the same clouds.

    Returns:
        By name: `touches` where there are any, `closeups`, and an `object-K` for each example; `training` where a run
        has validated, and `over-touches` where the runs are of different numbers of touches (`…-touches.N`).

    Raises:
        UserError: as `gather` raises it.
    """
    read = gather(folders)
    drawn = {"closeups": closeups(read.subjects[:OBJECTS], read.networks)}
    if felt := [subject for subject in read.subjects if subject.touches]:
        drawn["touches"] = touches(felt[:OBJECTS])
    drawn |= {f"object-{k}": side_by_side(subject) for k, subject in enumerate(read.subjects)}
    return drawn | _curves(read)


def touches(subjects: Sequence[Subject]) -> Image.Image:
    """Fig. 4: a row for each object, which has touches: the truth; input and touches; the first touch alone."""
    rows = []
    for subject in subjects:
        example, alone = subject.example, subject.touches[0]
        view = camera(example.truth)
        rows.append(
            [
                Panel(
                    f"(a) {example.name}, {len(example.truth)} points",
                    picture(view, [_layer(example.truth, TRUTH)], SIZE),
                ),
                Panel(
                    f"(b) {_said(subject)}",
                    picture(view, _input_layers(subject), SIZE),
                ),
                Panel(
                    f"(c) the first touch, {len(alone)} points", picture(camera(alone), [_layer(alone, TOUCH)], SIZE)
                ),
            ]
        )
    return sheet("Truth, input and touches", rows)


def closeups(subjects: Sequence[Subject], networks: Sequence[str]) -> Image.Image:
    """Fig. 5: a column for each object: input and touches, what each network makes of them, and the truth.

    Beside each picture is a part of it, at the touch that lies nearest to the viewer, or without any touch at the
    nearest point of the truth: a rule that looks at no result.
    """
    errors = [{name: _errors(subject, name) for name in networks} for subject in subjects]
    end = scale_end([one for of_object in errors for one in of_object.values()])
    columns = []
    for letter, subject, of_object in zip(string.ascii_lowercase, subjects, errors, strict=False):
        example, view = subject.example, camera(subject.example.truth)
        close = _close(view, subject)
        columns.append(
            [
                Panel(f"({letter}) {example.name}: {_said(subject)}", _pair(view, close, *_input_layers(subject))),
                *(
                    Panel(_mean(name, one), _pair(view, close, _coloured(example.predictions[name], one, end)))
                    for name, one in of_object.items()
                ),
                Panel(f"truth, {len(example.truth)} points", _pair(view, close, _layer(example.truth, TRUTH))),
            ]
        )
    return sheet("Input, networks and truth, with a part of each close up", list(zip(*columns, strict=True)), end)


def side_by_side(subject: Subject) -> Image.Image:
    """Fig. 6: one object: the truth, input and touches, and what every network and baseline makes of them."""
    example, view = subject.example, camera(subject.example.truth)
    errors = {name: _errors(subject, name) for name in example.predictions}
    end = scale_end(list(errors.values()))
    panels = [
        (f"truth, {len(example.truth)} points", picture(view, [_layer(example.truth, TRUTH)], SIZE)),
        (_said(subject), picture(view, _input_layers(subject), SIZE)),
        *(
            (_mean(name, one), picture(view, [_coloured(example.predictions[name], one, end)], SIZE))
            for name, one in errors.items()
        ),
    ]
    lettered = [Panel(f"({_letter(k)}) {said}", image) for k, (said, image) in enumerate(panels)]
    rows = [lettered[k : k + COLUMNS] for k in range(0, len(lettered), COLUMNS)]
    return sheet(example.name, rows, end)


def _curves(read: Gathered) -> dict[str, Image.Image]:
    """The validated Chamfer distance over the steps of training, and the first metric over the number of touches."""
    drawn = {}
    checks = {
        name: {line["step"]: 1000 * line["validation"]["cd"] for line in history if "cd" in line.get("validation", {})}
        for name, history in zip(read.networks, read.histories, strict=True)
        if history is not None
    }
    checks = {name: values for name, values in checks.items() if values}
    lines: dict[str, chart.Line]
    if checks:
        steps = sorted({step for values in checks.values() for step in values})
        lines = {name: ([values.get(step, math.nan) for step in steps], None) for name, values in checks.items()}
        drawn["training"] = chart.draw("Validation", "step", scaled("cd", 1000.0), steps, lines)
    metric, note = next(iter(read.runs[0].metrics.items()))
    label = scaled(metric, note.scale)
    axis, rows = varied([row for row in variants(read.runs, "") if metric in row.values])
    numbers = sorted({number for of_label in rows.values() for number in of_label})
    if axis == "touches" and len(numbers) > 1:
        seeds = len({run.seed for run in read.runs}) > 1
        lines = {}
        for name, of_label in rows.items():
            means = [of_label[k].mean(metric) if k in of_label else math.nan for k in numbers]
            spreads = [of_label[k].spread(metric, over_seeds=seeds) or 0.0 if k in of_label else 0.0 for k in numbers]
            lines[VARIED.sub("", "-" + read.runs[0].name).strip("-") if name == axis else name] = (means, spreads)
        over = "seeds" if seeds else "objects"
        title = f"{label} over touches, mean ± sample standard deviation over {over}"
        drawn["over-touches"] = chart.draw(title, "touches", label, numbers, lines)
    return drawn


def _close(view: Camera, subject: Subject) -> Camera:
    places = np.stack([touch.mean(0) for touch in subject.touches]) if subject.touches else subject.example.truth
    return view.closer(places[np.argmax(view.seen(places)[:, 2])], view.half / ZOOM)


def _pair(view: Camera, close: Camera, *layers: Layer) -> np.ndarray:
    """The whole, where the part is framed, and the part."""
    small = [replace(layer, radius=layer.radius * CLOSE / SIZE) for layer in layers]
    large = [replace(layer, radius=min(1.5 * layer.radius, SIZE / 90)) for layer in layers]
    whole = Image.fromarray(picture(view, small, CLOSE))
    x, y, _ = view.seen(close.centre[None])[0] / view.half
    middle, half = np.array([1 + x, 1 - y]) * CLOSE / 2, close.half / view.half * CLOSE / 2
    ImageDraw.Draw(whole).rectangle((*(middle - half), *(middle + half)), outline=INK)
    line = np.broadcast_to(np.array(rgb(INK), np.uint8), (CLOSE, 1, 3))
    return np.hstack([np.asarray(whole), line, picture(close, large, CLOSE)])


def _layer(cloud: Cloud, colour: np.ndarray) -> Layer:
    return Layer(cloud, colour, disc_radius(len(cloud), SIZE))


def _coloured(cloud: Cloud, errors: np.ndarray, end: float) -> Layer:
    return _layer(cloud, error_colours(errors, end))


def _input_layers(subject: Subject) -> list[Layer]:
    """The sparse cloud, and the touches in smaller discs, as they are dense."""
    small = disc_radius(8192, SIZE)
    felt = [Layer(touch, TOUCH, small) for touch in subject.touches]
    return [_layer(subject.example.input, INPUT), *felt]


def _errors(subject: Subject, name: str) -> np.ndarray:
    return distance(subject.example.predictions[name], subject.example.truth) * ERROR_SCALE


def _mean(name: str, errors: np.ndarray) -> str:
    return f"{name}, mean error {errors.mean():.3g} ×10⁻³"


def _said(subject: Subject) -> str:
    count = len(subject.touches)
    touched = f", {count} touch{'es' if count > 1 else ''}" if count else ""
    return f"input, {len(subject.example.input)} points{touched}"


def _letter(k: int) -> str:
    """From a to z, then aa, ab and so on."""
    letters = string.ascii_lowercase
    return letters[k] if k < len(letters) else letters[k // len(letters) - 1] + letters[k % len(letters)]
