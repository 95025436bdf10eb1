"""Evaluation: a network beside baselines on one split, every metric for every object."""

import multiprocessing
import os
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from pcsr.contracts import Shapes
from pcsr.data.dataset import Split
from pcsr.geometry.interpolation import midpoint
from pcsr.metrics import METRICS
from pcsr.model import Network
from pcsr.recipe import Recipe
from pcsr.registry import Registry
from pcsr.upsample import upsample_as

Cloud = Float[np.ndarray, "n 3"]


@dataclass(frozen=True)
class Method:
    """Something that makes a sparse cloud dense."""

    name: str
    parameters: int
    upsample: Callable[[Cloud, Sequence[Cloud]], Cloud]
    """Sparse cloud and touches, in one frame, to the dense cloud in that frame."""


@dataclass(frozen=True)
class Scores:
    """What one method reached."""

    method: Method
    seconds: float
    """Mean wall time for a cloud."""
    values: dict[str, list[float]]
    """Metric by name, one value for each object."""
    dense: Float[np.ndarray, "k rn 3"]


def methods(recipe: Recipe, network: Network) -> list[Method]:
    """The recipe's network and the baselines that it wants beside it."""
    rate = recipe.data.rate
    passes = 2 if rate >= 16 else 1  # 16x as 4x twice, as the field does it and as is much better
    baselines = {"midpoint": lambda points, touches: midpoint(points, rate, passes=passes)}
    ours = Method(
        recipe.name,
        network.parameter_count,
        lambda points, touches: upsample_as(recipe, network, points, touches),
    )
    return [ours, *(Method(name, 0, baselines[name]) for name in recipe.evaluate.beside)]


def evaluate(
    recipe: Recipe,
    registry: Registry,
    compared: Sequence[Method],
    split: Split,
    *,
    jobs: int | None = None,
    advance: Callable[[], None] = lambda: None,
) -> list[Scores]:
    """Let every method upsample every object, then measure.

    Clouds are compared in the frame in which the truth fills the unit sphere; `p2f` too.

    Args:
        recipe: says how many touches and which metrics.
        registry: gives the meshes, if a metric needs them.
        compared: what to compare.
        split: what to compare on.
        jobs: processes that measure; all cores by default.
        advance: called whenever one object was upsampled or measured, 2·k times for each method.
    """
    count = recipe.data.touches
    timed: list[tuple[np.ndarray, float]] = []
    for method in compared:
        clouds: list[Cloud] = []
        seconds: list[float] = []
        for cloud, felt in zip(split.points, split.touches, strict=True):
            points, touches = cloud.numpy(), felt.numpy()
            start = time.perf_counter()
            clouds.append(method.upsample(points, list(touches[:count])))
            seconds.append(time.perf_counter() - start)
            advance()
        timed.append((np.stack(clouds), float(np.mean(seconds))))
    tasks = [
        _Task(recipe.evaluate.metrics, cloud, truth.numpy(), mesh)
        for dense, _ in timed
        for cloud, truth, mesh in zip(dense, split.truth, _meshes(recipe, registry, split), strict=True)
    ]
    measured = _measured(tasks, jobs or os.cpu_count() or 1, advance)
    scores = []
    for method, (dense, mean_seconds) in zip(compared, timed, strict=True):
        rows = [next(measured) for _ in range(len(split))]
        values = {str(name): [row[name] for row in rows] for name in recipe.evaluate.metrics}
        scores.append(Scores(method, mean_seconds, values, dense))
    return scores


@dataclass(frozen=True)
class _Task:
    metrics: Sequence[str]
    dense: Cloud
    truth: Cloud
    mesh: tuple[np.ndarray, np.ndarray] | None


def _meshes(recipe: Recipe, registry: Registry, split: Split) -> Iterator[tuple[np.ndarray, np.ndarray] | None]:
    """Vertices and faces of each object in the truth's frame, only if a metric asks for them."""
    needed = any(METRICS[name].needs_mesh for name in recipe.evaluate.metrics)
    shapes: Shapes | None = recipe.data.shapes.build(registry, "shapes") if needed else None
    for i, name in enumerate(split.names):
        if shapes is None:
            yield None
        else:
            mesh = shapes.item(name).mesh
            yield split.spheres[i].apply(mesh.vertices), np.asarray(mesh.faces)


def _measured(tasks: Sequence[_Task], jobs: int, advance: Callable[[], None]) -> Iterator[dict[str, float]]:
    """The metrics of each task, in order."""
    if jobs == 1 or len(tasks) < 8:  # starting processes costs more than it saves
        results = map(_measure, tasks)
        for result in results:
            advance()
            yield result
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, torch.set_num_threads, (1,)) as pool:
        for result in pool.map(_measure, tasks, chunksize=2):
            advance()
            yield result


def _measure(task: _Task) -> dict[str, float]:
    prediction = torch.from_numpy(task.dense).float()[None]
    truth = torch.from_numpy(task.truth).float()[None]
    return {name: METRICS[name](prediction, truth, task.mesh) for name in task.metrics}
