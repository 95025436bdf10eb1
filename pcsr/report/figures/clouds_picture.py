"""Picture of any clouds side by side, from one direction, with a key to their colours."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from pcsr.extras import imported
from pcsr.report.clouds.colouring import SOURCE, Classes, Scale
from pcsr.report.clouds.extent import Cube
from pcsr.report.clouds.shown import Scene, ShownCloud, rows_of
from pcsr.report.colours import INK, MARK, TRUTH, VALUE_SCALE
from pcsr.report.figures.canvas import USER, label
from pcsr.report.figures.clouds import Camera, Layer
from pcsr.report.figures.panels import GAP, Panel, panel_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIZES = {1: 6.0, 2: 4.5}
"""Side of a panel in inches, by number of clouds."""
SMALL = 3.4
"""Side of a panel of more clouds."""
COLUMNS = 4
"""Largest number of panels in a row."""
LINE = 0.3
"""Height of a line of the key, in inches."""
NO_VALUE = "#a9b2bb"
"""Colour of points without a value in the column of the colours."""


def clouds_picture(scene: Scene) -> "Figure":
    """Draw clouds as figure, seen from the direction in which their page shows them first.

    Args:
        scene: the clouds.

    Raises:
        UserError: the extra `[report]` is not installed.
    """
    panels = [
        Panel(cloud.caption, _camera(scene, cloud.cube), _layers(scene, cloud, _diameter(len(cloud.points))))
        for cloud in scene.clouds
    ]
    rows = [panels[k : k + COLUMNS] for k in range(0, len(panels), COLUMNS)]
    names = [cloud.name for cloud in scene.clouds]
    size, entries = SIZES.get(len(panels), SMALL), _entries(scene)
    columns = max(1, int(len(rows[0]) * size / 1.5))
    key = scene.colours.key
    heading = label(key.name, 40, 1) if isinstance(key, Classes) and key.name != SOURCE else None
    lines = -(-len(entries) // columns) + (heading is not None)
    below = GAP + LINE * (2 * isinstance(key, Scale) + lines)
    figure = panel_figure(", ".join(names), rows, size, below=below)
    if isinstance(key, Scale):
        _bar(figure, key)
    if entries:
        patch = imported("matplotlib.patches", USER).Patch
        figure.legend(
            handles=[patch(color=colour, label=label(text, 40, 1)) for text, colour in entries],
            loc="lower right",
            ncols=min(columns, len(entries)),
            title=heading,
            title_fontsize=8,
            alignment="left",
            fontsize=8,
            frameon=False,
            labelcolor=INK,
        )
    return figure


def _camera(scene: Scene, cube: Cube) -> Camera:
    """Camera from the direction that page.js calls home; its window holds all clouds of the cube."""
    towards = np.array([1.0, 1.0, 0.7])
    towards /= np.linalg.norm(towards)
    right = np.array([-1.0, 1.0, 0.0]) / np.sqrt(2)
    camera = Camera(np.stack([right, np.cross(towards, right), towards]), cube.middle, cube.half, unit="")
    reach = max(np.abs(camera.seen(one.points)[:, :2]).max() for one in scene.clouds if one.cube is cube)
    return replace(camera, half=1.08 * float(reach) or cube.half)


def _diameter(count: int) -> float:
    """Diameter of discs, as a fraction of the window's side."""
    return float(np.clip(0.4 / max(count, 1) ** 0.5, 1 / 400, 1 / 90))


def _layers(scene: Scene, cloud: ShownCloud, diameter: float) -> list[Layer]:
    """Layers of a cloud's points, and of the touches."""
    key, colours, points = scene.colours.key, cloud.colours, cloud.points
    layers = []
    if colours is None:
        layers.append(Layer(points, _rgb(TRUTH), diameter))
    elif isinstance(key, Scale):
        known = np.isfinite(colours)
        layers.append(Layer(points[known], _on_scale(colours[known], key), diameter))
        layers.append(Layer(points[~known], _rgb(NO_VALUE), diameter))
    elif isinstance(key, Classes):
        layers += [Layer(points[rows], _rgb(colour), diameter) for _, colour, rows in rows_of(cloud, key)]
        layers.append(Layer(points[colours < 0], _rgb(NO_VALUE), diameter))
    else:
        layers.append(Layer(points, colours / 255.0, diameter))
    return [*layers, Layer(scene.touched[cloud.cube.holds(scene.touched)], _rgb(MARK), diameter)]


def _entries(scene: Scene) -> list[tuple[str, str]]:
    """Label and colour of each class that some cloud has, and of the touches."""
    key = scene.colours.key
    entries: list[tuple[str, str]] = []
    if isinstance(key, Classes):
        used = {label for cloud in scene.clouds for label, _, _ in rows_of(cloud, key)}
        listed = zip(key.labels, key.colours, strict=True)
        entries = [(text, colour) for text, colour in listed if text in used]
    return [*entries, *([("recorded touches", MARK)] if len(scene.touched) else [])]


def _bar(figure: "Figure", scale: Scale) -> None:
    """Add the scale of a column's colours at the lower left."""
    width, height = figure.get_size_inches()
    norm = imported("matplotlib.colors", USER).Normalize(scale.low, scale.high)
    mappable = imported("matplotlib.cm", USER).ScalarMappable(norm, _value_map())
    axes = figure.add_axes((2 * GAP / width, 1.6 * LINE / height, min(3.0, width / 2) / width, 0.1 / height))
    bar = figure.colorbar(mappable, cax=axes, orientation="horizontal")
    bar.ax.tick_params(labelsize=8)
    bar.set_label(label(scale.name, 40, 1), fontsize=8, loc="left")


def _on_scale(values: Float[np.ndarray, " n"], scale: Scale) -> Float[np.ndarray, "n 3"]:
    span = scale.high - scale.low
    shares = (values - scale.low) / span if span > 0 else np.full(len(values), 0.5)
    return np.asarray(_value_map()(shares.clip(0, 1)), np.float64)[:, :3]


def _value_map() -> Any:
    return imported("matplotlib.colors", USER).LinearSegmentedColormap.from_list("values", VALUE_SCALE)


def _rgb(colour: str) -> Float[np.ndarray, "3"]:
    """Red, green and blue, 0 to 1, of ``#rrggbb``."""
    return np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])
