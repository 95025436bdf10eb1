"""Making the samples of a data set, object by object, in the processes of a worker pool."""

import functools
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pcsr.contracts import ShapeSource, TouchSource
from pcsr.data.plan import Plan
from pcsr.data.sample import Rejected, Sample, make_sample
from pcsr.errors import RunError, UserError
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Registry
from pcsr.recipe import DATA, Recipe, from_resolved
from pcsr.workers import WorkerPool

CHUNK = 4
"""Objects that a process makes at a time: enough to hide the traffic, few enough to share evenly."""


def results(plan: Plan, names: Sequence[str], pool: WorkerPool) -> Iterator[tuple[str, Sample | Rejected]]:
    """Each object's name with its sample, or with the reason why there is none, in order."""
    if len(names) <= 2 * CHUNK:  # to start processes would take longer
        pool = WorkerPool(None, 1)
    recipe, files = json.dumps(plan.recipe.resolved()), tuple(str(file.resolve()) for file in plan.files)
    make = functools.partial(_make_chunk, recipe, files)
    chunks = [tuple(names[i : i + CHUNK]) for i in range(0, len(names), CHUNK)]
    for chunk, made in zip(chunks, pool.map(make, chunks), strict=True):
        yield from zip(chunk, made, strict=True)


def _make_chunk(recipe: str, files: tuple[str, ...], names: tuple[str, ...]) -> list[Sample | Rejected]:
    worker = _worker(recipe, files)
    return [worker.make(name) for name in names]


@functools.lru_cache(maxsize=2)
def _worker(recipe: str, files: tuple[str, ...]) -> "_Worker":
    # Plugins given as files are loaded in each process: their classes are not importable by name otherwise.
    registry = load_plugins([Path(file) for file in files])
    plain: dict[str, Any] = json.loads(recipe)
    checked = from_resolved(plain, registry, parts=DATA)
    if checked.code != plain.get("code", {}):
        names = " and ".join(Path(file).name for file in files) or "a plugin"
        raise RunError(f"the code of {names} is another here than where the building began: build again")
    return _Worker(checked, registry)


class _Worker:
    """What one process needs to make samples."""

    def __init__(self, recipe: Recipe, registry: Registry) -> None:
        self.recipe = recipe
        self.shapes: ShapeSource = recipe.data.shapes.build(registry, "shapes")
        self.source: TouchSource = recipe.data.touch.build(registry, "touch")

    def make(self, name: str) -> Sample | Rejected:
        """One sample, or the reason why there is none: one bad object does not stop the others."""
        recipe = self.recipe
        try:
            item = self.shapes.item(name)
            return make_sample(item, self.source, recipe.data, recipe.most_touches, recipe.data_seed)
        except UserError as error:
            return Rejected(str(error))
        except Exception as error:  # one object's trouble must not end hours of building
            return Rejected(f"{name}: {type(error).__name__}: {error}", fault=True)
