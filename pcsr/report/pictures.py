"""Clouds as pictures: points as small discs, seen in parallel from one side, the nearer in front of the farther."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int, UInt8
from PIL import Image

from pcsr.report.lettering import rgb
from pcsr.report.results import Cloud
from pcsr.report.views import COLOURS

FINE = 3
"""Each pixel is the mean of so many each way, which softens edges."""
TURN, TILT = math.radians(35), math.radians(25)
"""From the view along the shortest principal axis: to the side, then from above."""
RIM = 0.8
"""Where a disc's edge begins, as a share of its radius: a darker rim tells neighbours apart."""
DARKER = 0.72
"""The rim's brightness."""
FADE = 0.5
"""How much paler the farthest points of a layer of one colour are than the nearest, which shows the form."""
AT_ONCE = 2_000
"""Points drawn together, which bounds the memory."""


@dataclass(frozen=True)
class Camera:
    """A square window at right angles to the line of sight."""

    axes: Float[np.ndarray, "3 3"]
    """Right, up and towards the viewer as rows, each of length 1."""
    centre: Float[np.ndarray, "3"]
    half: float
    """Half the window's side, in the clouds' unit."""
    depth: float = math.inf
    """Points farther than this before or behind the centre are not shown."""

    def seen(self, cloud: Cloud) -> Float[np.ndarray, "n 3"]:
        """Right, up and towards the viewer from the centre, in the clouds' unit."""
        return np.asarray((cloud.astype(np.float64) - self.centre) @ self.axes.T)

    def closer(self, place: Float[np.ndarray, "3"], half: float) -> "Camera":
        """The same direction onto a cube around a place."""
        return replace(self, centre=place.astype(np.float64), half=half, depth=half)


@dataclass(frozen=True)
class Layer:
    """Points that are drawn alike."""

    points: Cloud
    colours: Float[np.ndarray, "*n 3"]
    """0 to 1: one of all points, or one of each."""
    radius: float
    """Of a disc, in pixels."""


def camera(cloud: Cloud) -> Camera:
    """The view of a cloud that its principal axes choose, a little from the side and from above.

    It follows the cloud however that is turned, moved or scaled, unless two principal axes are of equal length or the
    cloud is symmetric, where nothing decides. The window holds the whole cloud.
    """
    points = cloud.astype(np.float64)
    centred = points - points.mean(0)
    _, columns = np.linalg.eigh(centred.T @ centred)
    right, up = columns[:, 2], columns[:, 1]
    # An axis has no direction of its own: it points where the cloud reaches farther.
    right, up = (axis if ((centred @ axis) ** 3).sum() >= 0 else -axis for axis in (right, up))
    tilt = np.array([[1, 0, 0], [0, math.cos(TILT), -math.sin(TILT)], [0, math.sin(TILT), math.cos(TILT)]])
    turn = np.array([[math.cos(TURN), 0, -math.sin(TURN)], [0, 1, 0], [math.sin(TURN), 0, math.cos(TURN)]])
    axes = tilt @ turn @ np.stack([right, up, np.cross(right, up)])
    seen = points @ axes.T
    low, high = seen.min(0), seen.max(0)
    return Camera(axes, (low + high) / 2 @ axes, 0.53 * float((high - low)[:2].max()) or 1.0)


def picture(view: Camera, layers: Sequence[Layer], size: int) -> UInt8[np.ndarray, "size size 3"]:
    """Draw clouds into one picture on white, together in order of their depth; `size` in pixels."""
    fine = size * FINE
    places = np.concatenate([view.seen(layer.points) for layer in layers])
    colours = np.concatenate([_shaded(view, layer) for layer in layers])
    radii = np.concatenate([np.full(len(layer.points), layer.radius * FINE) for layer in layers])
    shown = np.abs(places[:, 2]) <= view.depth
    places, colours, radii = places[shown], colours[shown], radii[shown]
    order = np.argsort(places[:, 2], kind="stable")
    across = np.stack([1 - places[:, 1] / view.half, 1 + places[:, 0] / view.half], 1) * fine / 2
    canvas = np.full((fine * fine, 3), 255, np.uint8)
    for start in range(0, len(order), AT_ONCE):
        some = order[start : start + AT_ONCE]
        pixels, owners, edge = _discs(across[some], radii[some], fine)
        shades = np.round(255 * np.stack([colours[some], DARKER * colours[some]], 1)).astype(np.uint8)
        canvas[pixels] = shades[owners, edge]  # of a pixel that is named more than once the last, nearest, stays
    return np.asarray(Image.fromarray(canvas.reshape(fine, fine, 3)).reduce(FINE))


def _shaded(view: Camera, layer: Layer) -> Float[np.ndarray, "n 3"]:
    """The colour of each point. Those that stand for errors must not fade."""
    if layer.colours.ndim == 2:
        return layer.colours
    behind = np.clip(0.5 - view.seen(layer.points)[:, 2:] / (2 * view.half), 0, 1)
    return np.asarray(layer.colours + (1 - layer.colours) * FADE * behind)


def _discs(
    centres: Float[np.ndarray, "n 2"], radii: Float[np.ndarray, " n"], size: int
) -> tuple[Int[np.ndarray, " p"], Int[np.ndarray, " p"], Int[np.ndarray, " p"]]:
    """The pixels of each disc in order of the discs, whose they are, and 1 on the rim; `centres` as row and column."""
    reach = math.ceil(float(radii.max()))
    steps = np.arange(-reach, reach + 1)
    grid = np.stack(np.meshgrid(steps, steps, indexing="ij"), -1).reshape(-1, 2)
    pixels = np.floor(centres).astype(np.int64)[:, None] + grid
    away = ((pixels + 0.5 - centres[:, None]) ** 2).sum(-1)
    inside = (away <= radii[:, None] ** 2) & ((pixels >= 0) & (pixels < size)).all(-1)
    owners = np.nonzero(inside)[0]
    kept = pixels[inside]
    edge = (away[inside] > (RIM * radii[owners]) ** 2).astype(np.int64)
    return kept[:, 0] * size + kept[:, 1], owners, edge


def disc_radius(count: int, size: int) -> float:
    """Pixels: so that `count` points spread over a picture make a surface, but stay points."""
    return float(np.clip(0.45 * size / math.sqrt(count), size / 240, size / 90))


def error_colours(errors: Float[np.ndarray, " n"], end: float) -> Float[np.ndarray, "n 3"]:
    """Colours of the report's scale from 0 to `end`, and the last one beyond."""
    stops = np.array([rgb(colour) for _, colour in COLOURS]) / 255
    places = [place for place, _ in COLOURS]
    return np.stack([np.interp(errors / end, places, stops[:, k]) for k in range(3)], 1)
