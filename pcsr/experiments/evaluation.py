"""Evaluation of a network and of baselines on one split: every metric for every object."""

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float

from pcsr.contracts import Metric, ShapeSource
from pcsr.data.dataset import Split
from pcsr.data.sample import covered_points
from pcsr.experiments.methods import Method, bound_stream, upsampled
from pcsr.metrics.one_cloud import measured
from pcsr.metrics.touch_effect import TouchEffect, touch_effect
from pcsr.plugins.registry import FILE, Registry
from pcsr.recipe import Recipe
from pcsr.results import MethodResult, validated
from pcsr.tensors import CloudArray, Mesh
from pcsr.threads import threads
from pcsr.workers import worker_pool


@dataclass(frozen=True)
class Evaluation:
    """Results of all methods on one split."""

    methods: list[MethodResult]
    """In the order in which the methods were given; seconds are the median over objects."""
    touch: TouchEffect | None
    """Effect of touch on the first method; `None` without touches."""
    dense: list[Float[np.ndarray, "k rn 3"]]
    """Dense clouds of each method."""
    threads: list[int]
    """Torch threads that each method was timed with."""
    load: float | None
    """Load average of the machine over the minute before the evaluation; `None` if the system reports none."""
    protocol: str | None
    """Name of the way in which the first method makes a cloud dense; `None` if that is no network."""


def metrics_of(recipe: Recipe, registry: Registry) -> dict[str, Metric]:
    """Return the metrics of a recipe by name."""
    return {name: registry.get("metric", name)() for name in recipe.evaluate.metrics}


def evaluate(
    recipe: Recipe,
    registry: Registry,
    compared: Sequence[Method],
    split: Split,
    *,
    jobs: int | None = None,
    advance: Callable[[], None] = lambda: None,
) -> Evaluation:
    """Upsample every object with every method, and compute the metrics of the dense clouds.

    All metrics are computed in the frame in which the true dense cloud fills the unit sphere. With touches, the first
    method also upsamples each object without touches, and with those of the next object if touches enter it as features
    alone: both measure the effect of touch. The time of these passes is not part of the method's `seconds`.

    Args:
        recipe: recipe with the number of touches and the names of the metrics.
        registry: installed parts.
        compared: methods to compare; the first is the recipe's network.
        split: objects on which the methods are compared.
        jobs: processes that compute metrics; by default one for each core.
        advance: called after each object was upsampled, and after its metrics were computed: 2·k times for each method
            and k objects.

    Raises:
        UserError: a metric is not finite.
    """
    metrics = metrics_of(recipe, registry)
    meshes = _meshes(recipe, registry, compared, split)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None  # Windows has none
    runs: list[_Timed] = []
    plain, exchanged = _Timed([], []), _Timed([], [])
    used: list[int] = []
    for position, method in enumerate(compared):
        runs.append(_Timed([], []))
        with threads(method.threads) as count:
            used.append(count)
            for i, mesh in enumerate(meshes):
                points, touches = split.points[i].numpy(), _touches(recipe, split, i)
                if method.upsample is not None:
                    runs[-1].add(method.upsample, points, touches)
                    if position == 0 and recipe.data.touches:
                        plain.add(method.upsample, points, [])
                        if method.exchange_touches and len(split) > 1:
                            exchanged.add(method.upsample, points, _touches(recipe, split, (i + 1) % len(split)))
                elif method.bound is not None:
                    stream = bound_stream(recipe.data_seed, split.names[i])
                    runs[-1].add(upsampled, method.name, method.bound, points, recipe.data.rate, mesh, stream)
                advance()
    # Another process cannot import a class of a plugin file by its name.
    here = {name: metric for name, metric in metrics.items() if registry.entries["metric", name].version == FILE}
    anywhere = {name: metric for name, metric in metrics.items() if name not in here}
    tasks = [
        _Task(anywhere, cloud, truth.numpy(), mesh)
        for timed in runs
        for cloud, truth, mesh in zip(timed.clouds, split.truth, meshes, strict=True)
    ]
    values_of_tasks = _measured(tasks, here, jobs, advance)
    touch = _touch_effect(recipe, split, compared, runs, plain, exchanged) if plain.clouds else None
    results = []
    for method, timed in zip(compared, runs, strict=True):
        rows = [next(values_of_tasks) for _ in range(len(split))]
        values = {str(name): [row[name] for row in rows] for name in recipe.evaluate.metrics}
        result = {"name": method.name, "parameters": method.parameters, "seconds": timed.median, "values": values}
        results.append(validated(MethodResult, result, f"method '{method.name}'", "mend the metric, or leave it out"))
    return Evaluation(results, touch, [np.stack(timed.clouds) for timed in runs], used, load, compared[0].protocol)


@dataclass(frozen=True)
class _Timed:
    """Dense clouds of one method, with the wall time of each."""

    clouds: list[CloudArray]
    seconds: list[float]

    def add(self, make: Callable[..., CloudArray], *args: object) -> None:
        start = time.perf_counter()
        self.clouds.append(make(*args))
        self.seconds.append(time.perf_counter() - start)

    @property
    def median(self) -> float:
        return float(np.median(self.seconds))


@dataclass(frozen=True)
class _Task:
    metrics: Mapping[str, Metric]
    dense: CloudArray
    truth: CloudArray
    mesh: Mesh | None


def _touches(recipe: Recipe, split: Split, i: int) -> list[CloudArray]:
    """Return the touches of an object, as many as the recipe uses."""
    return list(split.touches[i][: recipe.data.touches].numpy())


def _meshes(recipe: Recipe, registry: Registry, compared: Sequence[Method], split: Split) -> list[Mesh | None]:
    """Return vertices and faces of each object in the frame of the truth; `None` if no metric or method needs them."""
    if not any(registry.get("metric", name).needs_mesh for name in recipe.evaluate.metrics) and all(
        method.upsample for method in compared
    ):
        return [None] * len(split)
    shapes: ShapeSource = recipe.data.shapes.build(registry, "shapes")
    meshes = (shapes.item(name).mesh for name in split.names)
    return [
        (sphere.normalize(mesh.vertices), np.asarray(mesh.faces))
        for sphere, mesh in zip(split.spheres, meshes, strict=True)
    ]


def _touch_effect(
    recipe: Recipe,
    split: Split,
    compared: Sequence[Method],
    runs: Sequence[_Timed],
    plain: _Timed,
    exchanged: _Timed,
) -> TouchEffect:
    """Compute the effect of touch on the first method."""
    touches = [touch[: recipe.data.touches] for touch in split.touches]
    touched = [
        covered_points(t.numpy(), list(touch.numpy())).any(0) for t, touch in zip(split.truth, touches, strict=True)
    ]
    with_touches, *others = ([_tensor(cloud) for cloud in timed.clouds] for timed in runs)
    return touch_effect(
        split.truth,
        [touch.flatten(0, 1) for touch in touches],
        [torch.from_numpy(mask) for mask in touched],
        with_touches,
        [_tensor(cloud) for cloud in plain.clouds],
        dict(zip((method.name for method in compared[1:]), others, strict=True)),
        compared[0].name,
        plain.median,
        [_tensor(cloud) for cloud in exchanged.clouds] or None,
    )


def _measured(
    tasks: Sequence[_Task], here: Mapping[str, Metric], jobs: int | None, advance: Callable[[], None]
) -> Iterator[dict[str, float]]:
    """Yield the metrics of each task, in order. Metrics in `here` are computed in this process."""
    few = len(tasks) < 8  # starting processes would take longer than the computation
    with worker_pool(1 if few else jobs) as workers:
        for task, result in zip(tasks, workers.map(_measure, tasks), strict=True):
            advance()
            yield result | (_measure(replace(task, metrics=here)) if here else {})


@threads(1)
def _measure(task: _Task) -> dict[str, float]:
    prediction, truth = _tensor(task.dense), _tensor(task.truth)
    return {name: measured(name, metric, prediction, truth, task.mesh) for name, metric in task.metrics.items()}


def _tensor(cloud: CloudArray) -> Float[torch.Tensor, "n 3"]:
    return torch.from_numpy(cloud).float()
