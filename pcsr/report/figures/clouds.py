"""Clouds in parallel projection: points as small discs, the nearer in front of the farther."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from pcsr.report.colours import LINE, SOFT
from pcsr.run_files import Cloud

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TURN, TILT = math.radians(35), math.radians(25)
"""Rotation of the view from the shortest principal axis: to the side, then upwards."""
DARKER = 0.72
"""Brightness of a disc's rim relative to the disc."""
FADE = 0.5
"""Fraction of white in the colour of the farthest points of a layer of one colour."""


@dataclass(frozen=True)
class Camera:
    """Square window at right angles to the line of sight."""

    axes: Float[np.ndarray, "3 3"]
    """Unit vectors as rows: right, up and towards the viewer."""
    centre: Float[np.ndarray, "3"]
    half: float
    """Half the window's side, in the unit of the clouds."""
    depth: float = math.inf
    """Points farther than this before or behind the centre are not shown."""
    unit: str = "radii"
    """Unit of the clouds, for the scale bar; it may be empty."""

    def seen(self, cloud: Cloud) -> Float[np.ndarray, "n 3"]:
        """Coordinates right, up and towards the viewer from the centre, in the unit of the clouds."""
        return np.asarray((cloud.astype(np.float64) - self.centre) @ self.axes.T)

    def closer(self, centre: Float[np.ndarray, "3"], half: float) -> "Camera":
        """Camera with the same direction whose window holds a cube of side 2·half."""
        return replace(self, centre=centre.astype(np.float64), half=half, depth=half)


@dataclass(frozen=True)
class Layer:
    """Points that are drawn alike."""

    points: Cloud
    colours: Float[np.ndarray, "*n 3"]
    """RGB, 0 to 1: one colour for all points, which fades with depth, or one for each, which does not."""
    diameter: float
    """Diameter of a disc, as a fraction of the window's side."""


def camera(cloud: Cloud) -> Camera:
    """Camera along the shortest principal axis of a cloud, turned by 35° and tilted by 25°.

    It is equivariant to rotation, translation and scale of the cloud, unless two principal axes are equally long or the
    cloud is symmetric. The window holds the whole cloud.
    """
    points = cloud.astype(np.float64)
    centred = points - points.mean(0)
    _, columns = np.linalg.eigh(centred.T @ centred)
    right, up = columns[:, 2], columns[:, 1]
    # The sign of an axis is arbitrary: it points to where the cloud reaches farther.
    right, up = (axis if ((centred @ axis) ** 3).sum() >= 0 else -axis for axis in (right, up))
    tilt = np.array([[1, 0, 0], [0, math.cos(TILT), -math.sin(TILT)], [0, math.sin(TILT), math.cos(TILT)]])
    turn = np.array([[math.cos(TURN), 0, -math.sin(TURN)], [0, 1, 0], [math.sin(TURN), 0, math.cos(TURN)]])
    axes = tilt @ turn @ np.stack([right, up, np.cross(right, up)])
    seen = points @ axes.T
    low, high = seen.min(0), seen.max(0)
    return Camera(axes, (low + high) / 2 @ axes, 0.53 * float((high - low)[:2].max()) or 1.0)


def draw_clouds(axes: "Axes", side: float, view: Camera, layers: Sequence[Layer]) -> None:
    """Draw clouds into one square plot, together in the order of their depth, with a scale bar.

    Args:
        axes: an empty, square plot.
        side: its side, in inches.
        view: the camera.
        layers: the clouds.
    """
    seen = np.concatenate([view.seen(layer.points) for layer in layers])
    colours = np.concatenate([_shaded(view, layer) for layer in layers])
    # Matplotlib has sizes in points, 1/72 inch.
    diameters = np.concatenate([np.full(len(layer.points), 72 * side * layer.diameter) for layer in layers])
    shown = np.flatnonzero(np.abs(seen[:, 2]) <= view.depth)
    shown = shown[np.argsort(seen[shown, 2], kind="stable")]
    style: dict[str, Any] = {"edgecolors": DARKER * colours[shown], "linewidths": 0.1 * diameters[shown]}
    axes.scatter(seen[shown, 0], seen[shown, 1], diameters[shown] ** 2, colours[shown], **style)
    axes.set(xlim=(-view.half, view.half), ylim=(-view.half, view.half), aspect="equal", xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set_color(LINE)
    _scale_bar(axes, view.half, view.unit)


def _scale_bar(axes: "Axes", half: float, unit: str) -> None:
    """Line of a round length at the lower left, with the length."""
    power = 10 ** math.floor(math.log10(half / 2))
    length = max(factor * power for factor in (1, 2, 5) if factor * power <= half / 2)
    left, bottom = -0.94 * half, -0.94 * half
    axes.plot((left, left + length), (bottom, bottom), color=SOFT, linewidth=1.5, solid_capstyle="butt")
    box = {"facecolor": "white", "alpha": 0.8, "linewidth": 0, "pad": 0.5}
    axes.text(left, bottom + 0.04 * half, f"{length:g} {unit}".rstrip(), fontsize=7, color=SOFT, va="bottom", bbox=box)


def _shaded(view: Camera, layer: Layer) -> Float[np.ndarray, "n 3"]:
    """Colour of each point; colours of errors do not fade."""
    if layer.colours.ndim == 2:
        return layer.colours
    behind = np.clip(0.5 - view.seen(layer.points)[:, 2:] / (2 * view.half), 0, 1)
    return np.asarray(layer.colours + (1 - layer.colours) * FADE * behind)


def disc_diameter(count: int) -> float:
    """Diameter of discs, as a fraction of the window's side, at which `count` points look like a surface of points."""
    return float(np.clip(0.9 / math.sqrt(count), 1 / 120, 1 / 45))
