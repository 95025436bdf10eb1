"""The figures of the paper for finished runs: touches (Fig. 4), close-ups (Fig. 5), networks side by side (Fig. 6)."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from pcsr.report.cloud_errors import SCALE, distance, scale_end
from pcsr.report.colours import INPUT, TOUCH, TRUTH
from pcsr.report.figures.canvas import error_colours
from pcsr.report.figures.clouds import Camera, Layer, camera, disc_diameter
from pcsr.report.figures.curves import curve_figures
from pcsr.report.figures.panels import Panel, letter, panel_figure
from pcsr.report.run_set import RunSet, SharedExample
from pcsr.run_files import Cloud

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIZE, CLOSE = 3.4, 2.4
"""Side of a square in inches: of a cloud alone, and of each of a pair of cloud and close-up."""
OBJECTS = 3
"""Number of objects in Figures 4 and 5, as in the paper."""
ZOOM = 3.0
"""Magnification of a close-up."""
COLUMNS = 4
"""Number of panels in a row of Figure 6."""


def figures(runs: RunSet, pictured: RunSet | None = None) -> "dict[str, Figure]":
    """All figures that the runs have clouds or numbers for.

    Args:
        runs: the runs.
        pictured: those of the runs whose clouds are drawn; None: all.

    Returns:
        Figures by name: `touches` where there are any, `closeups`, and an `object-K` for each example; `training` where
        a run has validated, and `over-touches` where the runs have different numbers of touches (`…-touches.N`).

    Raises:
        UserError: the extra `[report]` is not installed.
    """
    clouds = pictured or runs
    drawn = {"closeups": closeups(clouds.examples[:OBJECTS], clouds.networks)}
    if touched := [example for example in clouds.examples if example.touches]:
        drawn["touches"] = touches(touched[:OBJECTS])
    drawn |= {f"object-{k}": side_by_side(example) for k, example in enumerate(clouds.examples)}
    return drawn | curve_figures(runs)


def touches(examples: Sequence[SharedExample]) -> "Figure":
    """Fig. 4: for each object, which has touches, a row of the truth, input and touches, and the first touch alone."""
    rows = []
    for shared in examples:
        example, alone = shared.example, shared.touches[0]
        view = camera(example.truth)
        rows.append(
            [
                Panel(f"(a) {example.name}, {_count(example.truth)}", view, [_layer(example.truth, TRUTH)]),
                Panel(f"(b) {_input_caption(shared)}", view, _input_layers(shared)),
                Panel(f"(c) the first touch, {_count(alone)}", camera(alone), [_layer(alone, TOUCH)]),
            ]
        )
    return panel_figure("Truth, input and touches", rows, SIZE)


def closeups(examples: Sequence[SharedExample], networks: Sequence[str]) -> "Figure":
    """Fig. 5: for each object a column of input and touches, each network's prediction, and the truth.

    Each panel has a close-up beside it, at the touch that is nearest to the viewer, or without any touch at the
    nearest point of the truth. No result decides what is shown.
    """
    errors = [{name: _errors(shared, name) for name in networks} for shared in examples]
    end = scale_end([one for of_object in errors for one in of_object.values()])
    columns = []
    for k, (shared, of_object) in enumerate(zip(examples, errors, strict=True)):
        example, view = shared.example, camera(shared.example.truth)
        close = closeup_camera(view, shared)
        pairs = [
            (f"({letter(k)}) {example.name}: {_input_caption(shared)}", _input_layers(shared)),
            *(_prediction(shared, name, one, end) for name, one in of_object.items()),
            (f"truth, {_count(example.truth)}", [_layer(example.truth, TRUTH)]),
        ]
        columns.append([Panel(caption, view, layers, close, _enlarged(layers)) for caption, layers in pairs])
    rows = list(zip(*columns, strict=True))
    return panel_figure("Input, networks and truth, each with a close-up", rows, CLOSE, end)


def side_by_side(shared: SharedExample) -> "Figure":
    """Fig. 6: the truth of one object, input and touches, and the prediction of every network and baseline."""
    example, view = shared.example, camera(shared.example.truth)
    errors = {name: _errors(shared, name) for name in example.predictions}
    end = scale_end(list(errors.values()))
    shown = [
        (f"truth, {_count(example.truth)}", [_layer(example.truth, TRUTH)]),
        (_input_caption(shared), _input_layers(shared)),
        *(_prediction(shared, name, one, end) for name, one in errors.items()),
    ]
    panels = [Panel(f"({letter(k)}) {caption}", view, layers) for k, (caption, layers) in enumerate(shown)]
    rows = [panels[k : k + COLUMNS] for k in range(0, len(panels), COLUMNS)]
    return panel_figure(example.name, rows, SIZE, end)


def closeup_camera(view: Camera, shared: SharedExample) -> Camera:
    """Camera of the close-up: around the touch nearest to the viewer, or the truth's nearest point without touches."""
    centres = np.stack([touch.mean(0) for touch in shared.touches]) if shared.touches else shared.example.truth
    return view.closer(centres[np.argmax(view.seen(centres)[:, 2])], view.half / ZOOM)


def _enlarged(layers: Sequence[Layer]) -> list[Layer]:
    return [replace(layer, diameter=min(2 * layer.diameter, 1 / 30)) for layer in layers]


def _layer(cloud: Cloud, colour: str) -> Layer:
    return Layer(cloud, _rgb(colour), disc_diameter(len(cloud)))


def _prediction(
    shared: SharedExample, name: str, errors: Float[np.ndarray, " n"], end: float
) -> tuple[str, list[Layer]]:
    """Caption and layer of a predicted cloud, coloured by its errors."""
    cloud = shared.example.predictions[name]
    layer = Layer(cloud, error_colours(errors, end), disc_diameter(len(cloud)))
    return f"{name}, mean distance to the truth {errors.mean():.3g} ×10⁻³", [layer]


def _input_layers(shared: SharedExample) -> list[Layer]:
    """The sparse cloud, and the touches in smaller discs, as they are denser."""
    touched = [Layer(touch, _rgb(TOUCH), disc_diameter(8192)) for touch in shared.touches]
    return [_layer(shared.example.input, INPUT), *touched]


def _rgb(colour: str) -> Float[np.ndarray, "3"]:
    """Red, green and blue, 0 to 1, of ``#rrggbb``."""
    return np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])


def _errors(shared: SharedExample, name: str) -> Float[np.ndarray, " n"]:
    return distance(shared.example.predictions[name], shared.example.truth) * SCALE


def _input_caption(shared: SharedExample) -> str:
    count = len(shared.touches)
    touched = f", {count} touch{'es' if count > 1 else ''}" if count else ""
    return f"input, {_count(shared.example.input)}{touched}"


def _count(cloud: Cloud) -> str:
    return f"{len(cloud)} points"
