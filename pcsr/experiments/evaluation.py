"""Evaluation: a network beside baselines on one split, every metric for every object."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
import trimesh
from jaxtyping import Float

from pcsr.contracts import ShapeSource
from pcsr.data.dataset import Split
from pcsr.data.sample import item_seed, touched_points
from pcsr.geometry.interpolation import midpoint
from pcsr.geometry.sampling import poisson_points
from pcsr.metrics import METRICS, Mesh
from pcsr.metrics.touch_effect import TouchEffect, touch_effect
from pcsr.network.network import Network
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe
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
    """Sparse cloud and touches, in one frame, to the dense cloud in that frame.

    None: it is given neither, and samples the true surface (`floor`).
    """


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


def methods(recipe: Recipe, network: Network) -> list[Method]:
    """The recipe's network and the baselines that it wants beside it."""
    rate = recipe.data.rate
    passes = 2 if rate >= 16 else 1  # 16x as 4x twice, as the field does it and as is much better
    baselines = {"midpoint": lambda points, touches: midpoint(points, rate, passes=passes), "floor": None}
    ours = Method(
        recipe.name,
        network.parameter_count,
        lambda points, touches: upsample_as(recipe, network, points, touches),
    )
    return [ours, *(Method(name, 0, baselines[name]) for name in recipe.evaluate.baselines)]


def needs_meshes(recipe: Recipe) -> bool:
    """Whether a recipe is evaluated on the true surfaces, beside the clouds of its data."""
    return "floor" in recipe.evaluate.baselines or _measured_on_meshes(recipe)


def _measured_on_meshes(recipe: Recipe) -> bool:
    return any(METRICS[name].needs_mesh for name in recipe.evaluate.metrics)


def floor(mesh: Mesh, count: int, seed: int, name: str) -> Cloud:
    """The true surface sampled once more: the error that is left to an upsampler which knows the surface.

    Blue noise that is independent of the truth, since its random numbers are another stream of the object's seed. An
    upsampler may come a little below it where it keeps points of a sparse cloud that is a part of the truth.

    Args:
        mesh: the true surface, in the frame in which the cloud is wanted.
        count: how many points.
        seed: of the data.
        name: the object's.

    Raises:
        UserError: the surface has no area.
    """
    rng = np.random.default_rng([item_seed(seed, name), 1])
    return poisson_points(trimesh.Trimesh(*mesh, process=False), count, rng)


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
                elif mesh is not None:
                    made[-1].add(floor, mesh, len(split.truth[i]), recipe.data_seed, split.names[i])
                advance()
    tasks = [
        _Task(recipe.evaluate.metrics, cloud, truth.numpy(), mesh)
        for timed in made
        for cloud, truth, mesh in zip(timed.clouds, split.truth, meshes, strict=True)
    ]
    measured = _measured(tasks, jobs, advance)
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
    metrics: Sequence[str]
    dense: Cloud
    truth: Cloud
    mesh: Mesh | None


def _meshes(recipe: Recipe, registry: Registry, compared: Sequence[Method], split: Split) -> list[Mesh | None]:
    """Vertices and faces of each object in the truth's frame, only if a metric or a method asks for them."""
    if not _measured_on_meshes(recipe) and all(method.upsample for method in compared):
        return [None] * len(split)
    shapes: ShapeSource = recipe.data.shapes.build(registry, "shapes")
    meshes = (shapes.item(name).mesh for name in split.names)
    return [
        (sphere.normalize(mesh.vertices), np.asarray(mesh.faces))
        for sphere, mesh in zip(split.spheres, meshes, strict=True)
    ]


def _touch_effect(
    recipe: Recipe, split: Split, compared: Sequence[Method], made: Sequence[_Timed], plain: _Timed
) -> TouchEffect:
    """What touch does to the first method."""
    touches = [touch[: recipe.data.touches] for touch in split.touches]
    felt = [
        touched_points(t.numpy(), list(touch.numpy())).any(0) for t, touch in zip(split.truth, touches, strict=True)
    ]
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


def _measured(tasks: Sequence[_Task], jobs: int | None, advance: Callable[[], None]) -> Iterator[dict[str, float]]:
    """The metrics of each task, in order."""
    few = len(tasks) < 8  # starting processes costs more than it saves
    with worker_pool(1 if few else jobs) as workers:
        for result in workers.map(_measure, tasks):
            advance()
            yield result


@threads(1)
def _measure(task: _Task) -> dict[str, float]:
    prediction, truth = _tensor(task.dense)[None], _tensor(task.truth)[None]
    return {name: METRICS[name](prediction, truth, task.mesh) for name in task.metrics}


def _tensor(cloud: Cloud) -> Float[torch.Tensor, "n 3"]:
    return torch.from_numpy(cloud).float()
