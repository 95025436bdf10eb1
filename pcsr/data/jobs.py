"""Sampling of the objects of a data set in the processes of a worker pool."""

import functools
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pcsr.contracts import ShapeSource, TouchSource
from pcsr.data.plan import Plan
from pcsr.data.sample import Rejection, Sample, make_sample
from pcsr.errors import RunError, UserError
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Registry
from pcsr.recipe import DATA, Recipe, from_resolved
from pcsr.workers import WorkerPool

CHUNK = 4
"""Number of objects that a process samples at a time: it hides the communication, and balances the processes."""


def results(plan: Plan, names: Sequence[str], pool: WorkerPool) -> Iterator[tuple[str, Sample | Rejection]]:
    """Yield the name of each object with its sample, or with the reason for its rejection, in order."""
    if len(names) <= 2 * CHUNK:  # starting processes would take longer
        pool = WorkerPool(None, 1)
    recipe, files = json.dumps(plan.recipe.resolved()), tuple(str(file.resolve()) for file in plan.files)
    make = functools.partial(_make_chunk, recipe, files)
    chunks = [tuple(names[i : i + CHUNK]) for i in range(0, len(names), CHUNK)]
    for chunk, samples in zip(chunks, pool.map(make, chunks), strict=True):
        yield from zip(chunk, samples, strict=True)


def _make_chunk(recipe: str, files: tuple[str, ...], names: tuple[str, ...]) -> list[Sample | Rejection]:
    worker = _worker(recipe, files)
    return [worker.make(name) for name in names]


@functools.lru_cache(maxsize=2)
def _worker(recipe: str, files: tuple[str, ...]) -> "_Worker":
    # Plugin files are loaded in each process, since their classes cannot be imported by name.
    registry = load_plugins([Path(file) for file in files])
    plain: dict[str, Any] = json.loads(recipe)
    checked = from_resolved(plain, registry, parts=DATA)
    if checked.code != plain.get("code", {}):
        names = " and ".join(Path(file).name for file in files) or "a plugin"
        raise RunError(f"the code of {names} differs between the processes of one build: build again")
    return _Worker(checked, registry)


class _Worker:
    """Parts that a process samples objects with."""

    def __init__(self, recipe: Recipe, registry: Registry) -> None:
        self.recipe = recipe
        self.shapes: ShapeSource = recipe.data.shapes.build(registry, "shapes")
        self.source: TouchSource = recipe.data.touch.build(registry, "touch")

    def make(self, name: str) -> Sample | Rejection:
        """Sample one object; any error becomes a rejection, so that a bad object does not stop the build."""
        recipe = self.recipe
        try:
            item = self.shapes.item(name)
            return make_sample(item, self.source, recipe.data, recipe.most_touches, recipe.data_seed)
        except UserError as error:
            return Rejection(str(error))
        except Exception as error:
            return Rejection(f"{name}: {type(error).__name__}: {error}", fault=True)
