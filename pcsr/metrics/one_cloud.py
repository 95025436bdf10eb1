"""Evaluation of one cloud: all metrics by name, in a frame of choice."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from pcsr.clouds.convert import convert
from pcsr.clouds.faults import warn_of_faults
from pcsr.clouds.meshes import check_faces
from pcsr.contracts import Metric
from pcsr.errors import UserError, did_you_mean
from pcsr.geometry.checks import check_cloud
from pcsr.geometry.frames import UnitSphere
from pcsr.metrics import METRICS, NamedMetric
from pcsr.metrics.emd import check_sizes
from pcsr.metrics.units import warn_of_units
from pcsr.plugins.loading import check_loaded, load_plugins, plugin_paths
from pcsr.tensors import Mesh
from pcsr.threads import threads
from pcsr.validation_messages import shown

LARGEST, SMALLEST = 1e150, 1e-150
"""Range of coordinates whose squares neither overflow nor underflow in double precision."""
IDENTITY = UnitSphere(np.zeros(3), 1.0)
"""Frame that leaves coordinates unchanged."""


def evaluate(
    prediction: Any,
    truth: Any,
    mesh: Any = None,
    *,
    frame: str = "truth",
    metrics: Sequence[str] | str | None = None,
    plugins: Sequence[str | Path] = (),
) -> dict[str, float]:
    """Evaluate a predicted cloud against the true one.

    Args:
        prediction: the predicted cloud, of any type that `Model.upsample` accepts.
        truth: the true cloud, of any such type.
        mesh: the true surface for metrics that need it: a trimesh, or a pair of vertices (v, 3) and faces (f, 3).
        frame: normalisation of the coordinates. "truth" scales everything by the unit sphere of the true cloud, as in
            pcsr's tables. "each" scales each cloud by its own unit sphere, as in most published tables; `p2f` then
            stays in the mesh's unit. "none" leaves coordinates unchanged.
        metrics: names of metrics. By default all of pcsr's that are possible: `p2f` needs a mesh, and `emd` needs
            clouds of the same size and, above 1024 points, the extra `[train]`. Metrics of plugins must be named.
        plugins: Python files with metrics.

    Returns:
        Value of each metric by its name, not multiplied by `Metric.scale`.

    Raises:
        UserError: a name or the frame is unknown, a metric is not possible, a point is not finite, or the coordinates
            are so large or small that their squares overflow or vanish in double precision.

    Warns:
        PcsrWarning: a cloud has sentinels of invalid pixels or far outliers, which are used like all other points, or
            the clouds or the mesh differ so much in size that their units must differ.

    Examples:
        >>> truth = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
        >>> evaluate(truth + [0.0, 0.0, 0.5], truth, metrics=["cd", "hd"])
        {'cd': 0.5, 'hd': 0.5}
        >>> evaluate(truth, truth)
        {'cd': 0.0, 'hd': 0.0, 'hd-pugcn': 0.0, 'emd': 0.0}
    """
    clouds = [convert(prediction).cloud.points, convert(truth).cloud.points]
    for cloud, which in zip(clouds, ("the prediction", "the truth"), strict=True):
        check_cloud(cloud, which)
    frames = {"truth": [clouds[1]] * 2, "each": clouds, "none": []}
    if frame not in frames:
        raise UserError(f"there is no frame '{frame}': {did_you_mean(frame, frames)}")
    surface = _surface(mesh)
    if metrics is None:
        left_out = {"emd"} if why_no_emd(*map(len, clouds)) else set()
        metrics = [
            name for name, metric in METRICS.items() if (surface or not metric.needs_mesh) and name not in left_out
        ]
    chosen = named([metrics] if isinstance(metrics, str) else metrics, plugins)
    spheres = [UnitSphere.fit(cloud) for cloud in frames[frame]] or [IDENTITY] * 2
    scaled = [_scaled(cloud, sphere, frame) for cloud, sphere in zip(clouds, spheres, strict=True)]
    for cloud, which in zip(clouds, ("the prediction", "the truth"), strict=True):
        warn_of_faults(cloud, which)
    if frame != "each":
        remedy = "convert one, or normalise each by itself (--frame each)"
        warn_of_units(clouds[0], "the prediction", clouds[1], "the truth", remedy=remedy)
    if surface:
        beside, which = (clouds[0], "the prediction") if frame == "each" else (clouds[1], "the truth")
        warn_of_units(surface[0], "the mesh", beside, which)
    judged, true = (torch.from_numpy(cloud) for cloud in scaled)
    values = {}
    with threads(1):
        for name, metric in chosen.items():
            if metric.needs_mesh and frame == "each":
                _scaled(surface[0] if surface else clouds[0], IDENTITY, "none")
                unscaled = torch.from_numpy(_scaled(clouds[0], IDENTITY, "none"))
                values[name] = measured(name, metric, unscaled, true, surface)
            elif metric.needs_mesh and surface is not None:
                values[name] = measured(
                    name, metric, judged, true, (_scaled(surface[0], spheres[1], frame), surface[1])
                )
            else:
                values[name] = measured(name, metric, judged, true, surface)
    return values


def named(names: Sequence[str], plugins: Sequence[str | Path] = ()) -> dict[str, Metric]:
    """Return metrics by name: those of pcsr, of installed plugins and of plugin files.

    Raises:
        UserError: there is none of this name, or a plugin that is asked for it cannot be loaded.
    """
    if not plugins and set(names) <= METRICS.keys():
        return {name: METRICS[name] for name in names}
    registry = load_plugins(plugin_paths(plugins))
    check_loaded(registry)
    return {name: registry.get("metric", name)() for name in names}


def measured(name: str, metric: Metric, prediction: Tensor, target: Tensor, mesh: Mesh | None) -> float:
    """Compute a metric, which may be a plugin's, on copies of the clouds.

    Args:
        name: name of the metric, for messages.
        metric: metric to compute.
        prediction: the predicted cloud, (p 3).
        target: the true cloud, (t 3).
        mesh: vertices and faces of the true surface, or None.

    Raises:
        UserError: the metric needs a mesh and there is none, or it does not return a finite number.
    """
    if metric.needs_mesh and mesh is None:
        raise UserError(f"metric '{name}' needs the true mesh: pass it, or leave the metric out")
    value = metric.measure(prediction.clone(), target.clone(), mesh)
    if isinstance(metric, NamedMetric):
        return value
    if not isinstance(value, int | float) or not math.isfinite(value):
        raise UserError(f"metric '{name}' gave {shown(value)}, not a finite number: mend it, or leave it out")
    return float(value)


def why_no_emd(prediction: int, truth: int) -> str:
    """Explain why `evaluate` leaves out the earth mover's distance by default; empty if it does not.

    Args:
        prediction: number of points of the cloud.
        truth: number of points of the true cloud.
    """
    try:
        check_sizes(prediction, truth)
    except UserError as error:
        return str(error)
    return ""


def _scaled(cloud: Float[np.ndarray, "n 3"], sphere: UnitSphere, frame: str) -> Float[np.ndarray, "n 3"]:
    """Transform a cloud into the frame of a sphere.

    Raises:
        UserError: the squares of the coordinates overflow or vanish in double precision.
    """
    with np.errstate(over="ignore", under="ignore"):
        inside: Float[np.ndarray, "n 3"] = (cloud - sphere.centre) / sphere.radius
    largest = float(np.abs(inside).max())
    if largest > LARGEST or (frame == "none" and 0 < largest < SMALLEST):
        raise UserError(
            f"in the frame '{frame}' coordinates reach {largest:.4g}, and double precision holds the squares of those "
            f"between {SMALLEST:g} and {LARGEST:g}: "
            + ("use the frame 'truth', or another unit" if frame == "none" else "give both clouds in the same unit")
        )
    return inside


def _surface(mesh: Any) -> Mesh | None:
    if mesh is None:
        return None
    try:
        vertices, faces = (mesh.vertices, mesh.faces) if hasattr(mesh, "faces") else mesh
        arrays = np.asarray(vertices), np.asarray(faces)
    except (TypeError, ValueError) as error:
        raise UserError(f"a {type(mesh).__name__} is no mesh: give a trimesh, or vertices and faces") from error
    if any(array.ndim != 2 or array.shape[1] != 3 for array in arrays):
        raise UserError(f"a mesh is vertices (v, 3) and faces (f, 3), got {arrays[0].shape} and {arrays[1].shape}")
    if arrays[0].dtype.kind not in "iuf" or arrays[1].dtype.kind not in "iu":
        raise UserError(
            f"a mesh needs vertices of real numbers and faces of integers, got {arrays[0].dtype} and {arrays[1].dtype}"
        )
    check_faces(arrays[1], len(arrays[0]), "the mesh")
    if not np.isfinite(arrays[0]).all():
        raise UserError("the mesh has vertices that are not finite: repair it")
    return arrays[0].astype(np.float64), arrays[1].astype(np.int64)
