"""One cloud beside the true one: every metric by its name, in a frame that is said."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch

from pcsr.clouds.convert import convert
from pcsr.errors import UserError, did_you_mean
from pcsr.geometry.frames import UnitSphere
from pcsr.metrics import METRICS, Mesh
from pcsr.metrics.emd import check_sizes
from pcsr.threads import threads


def evaluate(
    prediction: Any, truth: Any, mesh: Any = None, *, frame: str = "truth", metrics: Sequence[str] | str | None = None
) -> dict[str, float]:
    """Every metric of a cloud by its name, unscaled.

    Args:
        prediction: the cloud to judge, of any kind that `Model.upsample` takes.
        truth: the true cloud.
        mesh: the true surface (trimesh, or vertices and faces), for the metrics that need it.
        frame: "truth": all are scaled so that the truth fills the unit sphere, as in pcsr's own tables; "each": each
            cloud fills its own, as in most published tables (`p2f` then stays in the mesh's unit); "none".
        metrics: their names; by default all that can be measured: `p2f` with a mesh, `emd` of clouds of one size, which
            above 1024 points takes the extra `[train]`.

    Raises:
        UserError: an unknown name or frame, or a metric that cannot be measured.
    """
    clouds = [convert(cloud).points for cloud in (prediction, truth)]
    frames = {"truth": [clouds[1]] * 2, "each": clouds, "none": []}
    if frame not in frames:
        raise UserError(f"there is no frame '{frame}': {did_you_mean(frame, frames)}")
    metrics = [metrics] if isinstance(metrics, str) else metrics
    surface = _surface(mesh)
    if metrics is None:
        left_out = {"emd"} if why_no_emd(*map(len, clouds)) else set()
        metrics = [
            name for name, metric in METRICS.items() if (surface or not metric.needs_mesh) and name not in left_out
        ]
    spheres = [UnitSphere.fit(cloud) for cloud in frames[frame]] or [UnitSphere(np.zeros(3), 1.0)] * 2
    tensors = [
        torch.from_numpy((cloud - sphere.centre) / sphere.radius)[None]
        for cloud, sphere in zip(clouds, spheres, strict=True)
    ]
    values = {}
    with threads(1):
        for name in metrics:
            if name not in METRICS:
                raise UserError(f"there is no metric '{name}': {did_you_mean(name, METRICS)}")
            metric = METRICS[name]
            if metric.needs_mesh and frame == "each":
                values[name] = metric(torch.from_numpy(clouds[0])[None], tensors[1], surface)
            elif metric.needs_mesh and surface is not None:
                scaled = (surface[0] - spheres[1].centre) / spheres[1].radius, surface[1]
                values[name] = metric(tensors[0], tensors[1], scaled)
            else:
                values[name] = metric(tensors[0], tensors[1], surface)
    return values


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


def _surface(mesh: Any) -> Mesh | None:
    if mesh is None:
        return None
    vertices, faces = (mesh.vertices, mesh.faces) if hasattr(mesh, "faces") else mesh
    return np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
