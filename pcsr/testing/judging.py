"""Checks of metrics and baselines, on clouds of an egg's surface."""

import numpy as np
import torch
import trimesh
from jaxtyping import Float
from torch import Tensor

from pcsr.contracts import Metric
from pcsr.geometry.sampling import surface_points
from pcsr.tensors import Mesh
from pcsr.testing.subject import Subject
from pcsr.testing.touching import egg

COUNT, RATE = 64, 4
"""Points of the clouds, and the rate of the baselines."""
ALIKE = 1e-9
"""Relative difference of errors that are the same but for rounding."""


def unit_egg() -> Mesh:
    """An egg in the unit sphere."""
    mesh = egg().mesh
    vertices = np.asarray(mesh.vertices, np.float64)
    vertices = vertices - vertices.mean(0)
    return vertices / np.linalg.norm(vertices, axis=1).max(), np.asarray(mesh.faces)


def sampled(mesh: Mesh, seed: int, count: int = COUNT) -> Float[np.ndarray, "n 3"]:
    """Random points of the surface."""
    return surface_points(trimesh.Trimesh(*mesh, process=False), count, np.random.default_rng(seed))


def describes(subject: Subject) -> None:
    """It says what it measures, and tables can show it."""
    metric: Metric = subject.built()
    text = getattr(metric, "description", None)
    if not (isinstance(text, str) and text.strip()) or "\n" in text:
        raise subject.failure(f"its `description` is {text!r}", "one line of text", "set description in the class")
    if isinstance(metric.scale, bool) or not isinstance(metric.scale, int) or metric.scale < 1:
        raise subject.failure(f"its `scale` is {metric.scale!r}", "a whole number from 1 on", "leave it at 1000")


def errors(subject: Subject) -> None:
    """It gives one finite number for two clouds, 0 or more, and 0 for a cloud and itself."""
    metric, mesh = subject.built(), unit_egg()
    one, other = (torch.from_numpy(sampled(mesh, seed)) for seed in (0, 1))
    apart = _measure(subject, metric, one, other, mesh)
    if not (np.isfinite(apart) and apart >= 0):
        raise subject.failure(f"two clouds are {apart!r} apart", "a finite number, 0 or more", "lower is better")
    same = _measure(subject, metric, one, one, mesh)
    if abs(same) > 1e-6:
        raise subject.failure(f"a cloud is {same:.3g} from itself", "0: nothing is better", "subtract that from it")


def order_free(subject: Subject) -> None:
    """It is the same however the points of either cloud are sorted."""
    metric, mesh = subject.built(), unit_egg()
    one, other = (torch.from_numpy(sampled(mesh, seed)) for seed in (0, 1))
    random = torch.Generator().manual_seed(0)
    mixed, stirred = (cloud[torch.randperm(len(cloud), generator=random)] for cloud in (one, other))
    before, after = _measure(subject, metric, one, other, mesh), _measure(subject, metric, mixed, stirred, mesh)
    if abs(before - after) > ALIKE * max(1.0, abs(before)):
        raise subject.failure(
            f"it changes from {before:.6g} to {after:.6g} when the points are sorted otherwise",
            "that clouds have no order",
            "match points by where they lie",
        )


def worse_is_more(subject: Subject) -> None:
    """Points that lie off the surface, by a tenth of its radius, are worse than points on it."""
    metric, mesh = subject.built(), unit_egg()
    on_it, truth = (torch.from_numpy(sampled(mesh, seed)) for seed in (0, 1))
    good, bad = (_measure(subject, metric, factor * on_it, truth, mesh) for factor in (1.0, 1.1))
    if not good < bad:
        raise subject.failure(
            f"it gives {good:.6g} to points of the surface and {bad:.6g} to points off it",
            "that lower is better",
            "turn its sign",
        )


def leaves_clouds(subject: Subject) -> None:
    """It does not change the clouds that it is given."""
    metric, mesh = subject.built(), unit_egg()
    one, other = (torch.from_numpy(sampled(mesh, seed)) for seed in (0, 1))
    before = one.clone(), other.clone()
    _measure(subject, metric, one, other, mesh)
    if not (torch.equal(one, before[0]) and torch.equal(other, before[1])):
        raise subject.failure("it changes a cloud that it is given", "that it only reads them", "work on a copy")


def _measure(subject: Subject, metric: Metric, one: Tensor, other: Tensor, mesh: Mesh) -> float:
    value = metric.measure(one, other, mesh)
    if not isinstance(value, float):
        raise subject.failure(f"`measure` gives a {type(value).__name__}", "a float", "return float(…)")
    return value


def dense(subject: Subject) -> None:
    """It gives `rate` times as many finite points, the same for the same random numbers, and leaves the cloud alone."""
    baseline, mesh = subject.built(), unit_egg()
    points = sampled(mesh, 0)
    given = points.copy()
    first, again = (
        baseline.upsample(given, RATE, mesh if baseline.needs_mesh else None, np.random.default_rng(0))
        for _ in range(2)
    )
    shape = getattr(first, "shape", None)
    if shape != (RATE * COUNT, 3) or not np.isfinite(first).all():
        raise subject.failure(
            f"of {COUNT} points at rate {RATE} it gives {shape}",
            f"{(RATE * COUNT, 3)}, all of them finite",
            "return rate·n points as an array",
        )
    if not np.array_equal(first, again):
        raise subject.failure(
            "the same random numbers give another cloud", "the same", "take random numbers from `rng` alone"
        )
    if not np.array_equal(points, given):
        raise subject.failure("it changes the cloud that it is given", "that it only reads it", "work on a copy")
