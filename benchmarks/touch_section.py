"""A picture of one touch before and after its registration: a section through the part, the cloud and the touch."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import trimesh
from jaxtyping import Float

import pcsr
from pcsr.files import write_bytes
from pcsr.metrics.p2f import point_to_surface
from pcsr.report.colours import INK, INPUT, SOFT, TOUCH, TRUTH
from pcsr.report.figures.canvas import encoded, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CLOUD_SLAB, TOUCH_SLAB = 1.2, 0.35
"""Points nearer to the plane of the section than this, in mm, are drawn."""
AROUND = 4.0
"""Margin around the touched points, in mm."""

Points = Float[np.ndarray, "n 3"]


def draw(mesh: trimesh.Trimesh, cloud: Points, folder: Path, number: int, path: Path) -> None:
    """Draw a touch as it was reported, and as it is registered to the cloud with all touches of its recording.

    Args:
        mesh: surface of the part.
        cloud: points that the camera saw.
        folder: recording of the touches.
        number: of the touch that is drawn.
        path: PNG file.
    """
    recording = pcsr.recorded.read(folder)
    touch = recording.touches[number]
    found = pcsr.register(recording.touches, cloud, pose_error=recording.pose_error).touches[number]
    kept = found.touch.points
    middle = kept.mean(0)
    pose = found.touch.poses[0]
    axes = _steepest(kept - middle, pose[:3, :3] / np.linalg.norm(pose[:3, 0]))
    outline = _outline(mesh, middle, axes, touch.unit)
    width = np.abs(((kept - middle) @ axes * touch.unit)[:, 0]).max() + AROUND
    figure = new_figure(9.0, 3.4, layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    for axes_of, title, points in zip(panels, ("as reported", "registered"), (touch.points, kept), strict=True):
        lines = axes_of.plot(*outline, color=TRUTH, linewidth=1.6, zorder=1)
        across = _slab((cloud - middle) @ axes * touch.unit, CLOUD_SLAB)
        seen = axes_of.scatter(*across, s=34, color=INPUT, zorder=3)
        across = _slab((points - middle) @ axes * touch.unit, TOUCH_SLAB)
        touched = axes_of.scatter(*across, s=7, color=TOUCH, zorder=2)
        off = point_to_surface(points, np.asarray(mesh.vertices), np.asarray(mesh.faces)).mean() * touch.unit
        _style(axes_of, f"{title}: {off:.2f} mm off the surface on average", width)
    panels[0].set_ylabel("along the sensor's axis, mm", color=INK)
    names = ("true surface", "cloud", "touched points")
    figure.legend([lines[0], seen, touched], names, loc="outside lower center", ncols=3, frameon=False)
    write_bytes(path, encoded(figure, "png"))


def _steepest(centred: Points, axes: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the axes of a section, the second across it: it is along that axis of the sensor that climbs more."""
    turned = axes[:, [1, 0, 2]] * [-1, 1, 1]
    return max(axes, turned, key=lambda one: float(np.ptp(_slab(centred @ one, np.ptp(centred @ one) / 20)[1])))


def _slab(local: Points, half: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the coordinates, in the plane, of the points near it."""
    near = local[np.abs(local[:, 1]) < half]
    return near[:, 0], near[:, 2]


def _outline(
    mesh: trimesh.Trimesh, middle: Float[np.ndarray, "3"], axes: Float[np.ndarray, "3 3"], unit: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return the section of the mesh as segments that are separated by NaN."""
    segments = trimesh.intersections.mesh_plane(mesh, axes[:, 1], middle)
    local = (segments - middle) @ axes * unit
    broken = np.concatenate([local, np.full((len(local), 1, 3), np.nan)], axis=1).reshape(-1, 3)
    return broken[:, 0], broken[:, 2]


def _style(axes: "Axes", title: str, width: float) -> None:
    axes.set_title(title, fontsize=11, loc="left", color=INK)
    axes.set_aspect("equal")
    axes.set_xlim(-width, width)
    axes.set_ylim(-0.65 * width, 0.25 * width)
    axes.set_xlabel("along the sensor's face, mm", color=INK)
    axes.tick_params(colors=SOFT, labelsize=9)
    for side, spine in axes.spines.items():
        spine.set_color(SOFT)
        spine.set_visible(side in ("left", "bottom"))
