"""Evaluation: a network beside baselines on one split, every metric for every object."""

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float

from pcsr.contracts import Baseline, Metric, ShapeSource
from pcsr.data.dataset import Split
from pcsr.data.sample import felt_points, item_seed
from pcsr.metrics.touch_effect import TouchEffect, touch_effect
from pcsr.network.network import Network
from pcsr.plugins.registry import FILE, Registry
from pcsr.recipe import Recipe
from pcsr.tensors import Mesh
from pcsr.threads import deserved, threads
from pcsr.upsample import points_at_once, upsample_as
from pcsr.workers import worker_pool

Cloud = Float[np.ndarray, "n 3"]


@dataclass(frozen=True)
class Method:
    """Something that makes a sparse cloud dense."""

    name: str
    parameters: int
    upsample: Callable[[Cloud, Sequence[Cloud]], Cloud] | None
    """Sparse cloud and touches, in one frame, to the dense cloud in that frame. None: see `bound`."""
    bound: Baseline | None = None
    """A baseline that is given the true surface too."""


@dataclass(frozen=True)
class Scores:
    """What one method reached."""

    method: Method
    seconds: float
    """Median wall time for a cloud."""
    values: dict[str, list[float]]
    """Metric by name, one value for each object."""
    dense: Float[np.ndarray, "k rn 3"]
    touch: TouchEffect | None = None
    """What touch does to the recipe's own network; None for baselines, and without touches."""
    threads: int = 1
    """With which it was timed."""
    load: float | None = None
    """The machine's load average of the minute before; None where the system has none."""


def methods(recipe: Recipe, network: Network, registry: Registry) -> list[Method]:
    """The recipe's network and the baselines that it wants beside it."""
    ours = Method(
        recipe.name,
        network.parameter_count,
        lambda points, touches: upsample_as(recipe, network, points, touches),
    )
    return [ours, *(_beside(name, registry.get("baseline", name)(), recipe) for name in recipe.evaluate.baselines)]


def _beside(name: str, baseline: Baseline, recipe: Recipe) -> Method:
    if baseline.needs_mesh:
        return Method(name, 0, None, baseline)
    rate, seed = recipe.data.rate, recipe.data_seed
    return Method(
        name, 0, lambda points, touches: baseline.upsample(points, rate, None, np.random.default_rng([seed, 1]))
    )


def measured_by(recipe: Recipe, registry: Registry) -> dict[str, Metric]:
    """The recipe's metrics by name."""
    return {name: registry.get("metric", name)() for name in recipe.evaluate.metrics}


def bound_stream(seed: int, name: str) -> np.random.Generator:
    """Random numbers of an object for a baseline that samples its surface: independent of those of the truth.

    Args:
        seed: of the data.
        name: the object's.
    """
    return np.random.default_rng([item_seed(seed, name), 1])


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

    Clouds are compared in the frame in which the truth fills the unit sphere; `p2f` too. Where there are touches, the
    first method upsamples each object a second time without them, to tell what they do. That doubles its time here,
    but not its `seconds`: it is timed apart.

    Args:
        recipe: says how many touches and which metrics.
        registry: gives the meshes, if a metric or a method needs them.
        compared: what to compare; the first is the recipe's own network.
        split: what to compare on.
        jobs: processes that measure; all cores by default.
        advance: called whenever one object was upsampled or measured, 2·k times for each method.
    """
    metrics = measured_by(recipe, registry)
    meshes = _meshes(recipe, registry, compared, split)
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None  # Windows has none
    made: list[_Timed] = []
    plain = _Timed([], [])
    used: list[int] = []
    for position, method in enumerate(compared):
        made.append(_Timed([], []))
        with threads(deserved(points_at_once(recipe), method.parameters)) as count:
            used.append(count)
            for i, mesh in enumerate(meshes):
                points, touches = split.points[i].numpy(), list(split.touches[i][: recipe.data.touches].numpy())
                if method.upsample is not None:
                    made[-1].add(method.upsample, points, touches)
                    if position == 0 and touches:
                        plain.add(method.upsample, points, [])
                elif method.bound is not None:
                    stream = bound_stream(recipe.data_seed, split.names[i])
                    made[-1].add(method.bound.upsample, points, recipe.data.rate, mesh, stream)
                advance()
    # What a plugin file brings has no name that another process could import it by.
    here = {name: metric for name, metric in metrics.items() if registry.entries["metric", name].version == FILE}
    anywhere = {name: metric for name, metric in metrics.items() if name not in here}
    tasks = [
        _Task(anywhere, cloud, truth.numpy(), mesh)
        for timed in made
        for cloud, truth, mesh in zip(timed.clouds, split.truth, meshes, strict=True)
    ]
    measured = _measured(tasks, here, jobs, advance)
    touch = _touch_effect(recipe, split, compared, made, plain) if plain.clouds else None
    scores: list[Scores] = []
    for method, timed, count in zip(compared, made, used, strict=True):
        rows = [next(measured) for _ in range(len(split))]
        values = {str(name): [row[name] for row in rows] for name in recipe.evaluate.metrics}
        effect = None if scores else touch
        scores.append(Scores(method, timed.median, values, np.stack(timed.clouds), effect, count, load))
    return scores


@dataclass(frozen=True)
class _Timed:
    """One method's clouds, and how long each took."""

    clouds: list[Cloud]
    seconds: list[float]

    def add(self, make: Callable[..., Cloud], *args: object) -> None:
        start = time.perf_counter()
        self.clouds.append(make(*args))
        self.seconds.append(time.perf_counter() - start)

    @property
    def median(self) -> float:
        return float(np.median(self.seconds))


@dataclass(frozen=True)
class _Task:
    metrics: Mapping[str, Metric]
    dense: Cloud
    truth: Cloud
    mesh: Mesh | None


def _meshes(recipe: Recipe, registry: Registry, compared: Sequence[Method], split: Split) -> list[Mesh | None]:
    """Vertices and faces of each object in the truth's frame, only if a metric or a method asks for them."""
    if not any(registry.get("metric", name).needs_mesh for name in recipe.evaluate.metrics) and all(
        method.upsample for method in compared
    ):
        return [None] * len(split)
    shapes: ShapeSource = recipe.data.shapes.build(registry, "shapes")
    meshes = (shapes.item(name).mesh for name in split.names)
    return [
        (sphere.apply(mesh.vertices), np.asarray(mesh.faces))
        for sphere, mesh in zip(split.spheres, meshes, strict=True)
    ]


def _touch_effect(
    recipe: Recipe, split: Split, compared: Sequence[Method], made: Sequence[_Timed], plain: _Timed
) -> TouchEffect:
    """What touch does to the first method."""
    touches = [touch[: recipe.data.touches] for touch in split.touches]
    felt = [felt_points(t.numpy(), list(touch.numpy())).any(0) for t, touch in zip(split.truth, touches, strict=True)]
    with_touches, *others = ([_tensor(cloud) for cloud in timed.clouds] for timed in made)
    return touch_effect(
        split.truth,
        [touch.flatten(0, 1) for touch in touches],
        [torch.from_numpy(mask) for mask in felt],
        with_touches,
        [_tensor(cloud) for cloud in plain.clouds],
        dict(zip((method.name for method in compared[1:]), others, strict=True)),
        compared[0].name,
        plain.median,
    )


def _measured(
    tasks: Sequence[_Task], here: Mapping[str, Metric], jobs: int | None, advance: Callable[[], None]
) -> Iterator[dict[str, float]]:
    """The metrics of each task, in order; those of `here` are measured in this process."""
    few = len(tasks) < 8  # starting processes costs more than it saves
    with worker_pool(1 if few else jobs) as workers:
        for task, result in zip(tasks, workers.map(_measure, tasks), strict=True):
            advance()
            yield result | (_measure(replace(task, metrics=here)) if here else {})


@threads(1)
def _measure(task: _Task) -> dict[str, float]:
    prediction, truth = _tensor(task.dense), _tensor(task.truth)
    return {name: metric.measure(prediction, truth, task.mesh) for name, metric in task.metrics.items()}


def _tensor(cloud: Cloud) -> Float[torch.Tensor, "n 3"]:
    return torch.from_numpy(cloud).float()
