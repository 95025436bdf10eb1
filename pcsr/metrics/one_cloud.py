"""One cloud beside the true one: every metric by its name, in a frame that is said."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from pcsr.clouds.convert import convert
from pcsr.clouds.formats.mesh import check_faces
from pcsr.contracts import Metric
from pcsr.errors import UserError, did_you_mean
from pcsr.geometry.frames import UnitSphere
from pcsr.metrics import METRICS
from pcsr.metrics.emd import check_sizes
from pcsr.plugins.loading import load_plugins
from pcsr.tensors import Mesh
from pcsr.threads import threads

LARGEST, SMALLEST = 1e150, 1e-150
"""Coordinates whose squares doubles hold."""
UNCHANGED = UnitSphere(np.zeros(3), 1.0)


def evaluate(
    prediction: Any,
    truth: Any,
    mesh: Any = None,
    *,
    frame: str = "truth",
    metrics: Sequence[str] | str | None = None,
    plugins: Sequence[str | Path] = (),
) -> dict[str, float]:
    """Every metric of a cloud by its name, unscaled.

    Args:
        prediction: the cloud to judge, of any kind that `Model.upsample` takes.
        truth: the true cloud.
        mesh: the true surface (trimesh, or vertices and faces), for the metrics that need it.
        frame: "truth": all are scaled so that the truth fills the unit sphere, as in pcsr's own tables; "each": each
            cloud fills its own, as in most published tables (`p2f` then stays in the mesh's unit); "none".
        metrics: their names; by default all that can be measured: `p2f` with a mesh, `emd` of clouds of one size, which
            above 1024 points takes the extra `[train]`. Those of plugins are measured where they are named.
        plugins: Python files with metrics.

    Raises:
        UserError: an unknown name or frame, a metric that cannot be measured, points that are not finite, or clouds of
            such different sizes that doubles do not hold the square of their distance.
    """
    clouds = [_finite(convert(cloud).points, which) for cloud, which in ((prediction, "prediction"), (truth, "truth"))]
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
    spheres = [UnitSphere.fit(cloud) for cloud in frames[frame]] or [UNCHANGED] * 2
    scaled = [_scaled(cloud, sphere, frame) for cloud, sphere in zip(clouds, spheres, strict=True)]
    judged, true = (torch.from_numpy(cloud) for cloud in scaled)
    values = {}
    with threads(1):
        for name, metric in chosen.items():
            if metric.needs_mesh and frame == "each":
                _scaled(surface[0] if surface else clouds[0], UNCHANGED, "none")
                unscaled = torch.from_numpy(_scaled(clouds[0], UNCHANGED, "none"))
                values[name] = metric.measure(unscaled, true, surface)
            elif metric.needs_mesh and surface is not None:
                values[name] = metric.measure(judged, true, (_scaled(surface[0], spheres[1], frame), surface[1]))
            else:
                values[name] = metric.measure(judged, true, surface)
    return values


def named(names: Sequence[str], plugins: Sequence[str | Path] = ()) -> dict[str, Metric]:
    """Metrics by name: those of pcsr, of installed plugins and of plugin files.

    Raises:
        UserError: there is none of this name, or a plugin that is asked for it cannot be loaded.
    """
    if not plugins and set(names) <= METRICS.keys():
        return {name: METRICS[name] for name in names}
    registry = load_plugins([Path(file) for file in plugins])
    return {name: registry.get("metric", name)() for name in names}


def why_no_emd(prediction: int, truth: int) -> str:
    """Why `evaluate` leaves the earth mover's distance out by default; empty where it is measured.

    Args:
        prediction: how many points the cloud has.
        truth: how many the true one has.
    """
    try:
        check_sizes(prediction, truth)
    except UserError as error:
        return str(error)
    return ""


def _finite(cloud: Float[np.ndarray, "n 3"], which: str) -> Float[np.ndarray, "n 3"]:
    bad = int((~np.isfinite(cloud).all(axis=1)).sum())
    if bad or not len(cloud):
        raise UserError(
            f"the {which} has {bad} points of {len(cloud)} with a coordinate that is not finite: remove them"
            if bad
            else f"the {which} has no points: there is nothing to measure"
        )
    return cloud


def _scaled(cloud: Float[np.ndarray, "n 3"], sphere: UnitSphere, frame: str) -> Float[np.ndarray, "n 3"]:
    """A cloud in the frame of a sphere, if the squares of its coordinates there are numbers that doubles hold."""
    with np.errstate(over="ignore", under="ignore"):
        inside: Float[np.ndarray, "n 3"] = (cloud - sphere.centre) / sphere.radius
    largest = float(np.abs(inside).max())
    if largest > LARGEST or (frame == "none" and 0 < largest < SMALLEST):
        raise UserError(
            f"in the frame '{frame}' coordinates reach {largest:.4g}, and doubles hold the squares of those between "
            f"{SMALLEST:g} and {LARGEST:g}: "
            + ("take the frame 'truth', or another unit" if frame == "none" else "are the clouds in one unit?")
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
            f"a mesh is vertices of real numbers and faces of whole ones, got {arrays[0].dtype} and {arrays[1].dtype}"
        )
    check_faces(arrays[1], len(arrays[0]), "the mesh")
    if not np.isfinite(arrays[0]).all():
        raise UserError("the mesh has vertices that are not finite: mend it")
    return arrays[0].astype(np.float64), arrays[1].astype(np.int64)
