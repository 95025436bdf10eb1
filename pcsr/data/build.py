"""Building a split: every object sampled and touched, on all cores, and kept for the next run."""

import multiprocessing
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import torch
from rich.progress import Progress

from pcsr.contracts import Shapes, TouchSource
from pcsr.data.dataset import Split
from pcsr.data.sample import Sample, make_sample
from pcsr.errors import RunError, UserError
from pcsr.plugins import load_plugins
from pcsr.recipe import Recipe
from pcsr.registry import Registry


def load_or_build(
    recipe: Recipe,
    registry: Registry,
    split: str,
    folder: Path,
    *,
    jobs: int | None = None,
    progress: Progress | None = None,
) -> Split:
    """The split from `folder`, where it is built first if it isn't there yet.

    Args:
        recipe: says which shapes, touches and numbers of points.
        registry: where the parts come from.
        split: "train", "validation" or "test".
        folder: holds one folder for each data fingerprint.
        jobs: processes; all cores by default.
        progress: shows a bar while building.

    Raises:
        UserError: the split is empty, or no object of it could be used.
    """
    path = folder / recipe.data_fingerprint[:12] / f"{split}.safetensors"
    if path.exists():
        return Split.load(path)
    built = build(recipe, registry, split, jobs=jobs or os.cpu_count() or 1, progress=progress)
    built.save(path)
    return built


def build(recipe: Recipe, registry: Registry, split: str, *, jobs: int = 1, progress: Progress | None = None) -> Split:
    """Build a split. The result does not depend on `jobs`."""
    shapes: Shapes = recipe.data.shapes.build(registry, "shapes")
    names = shapes.names(split)
    if not names:
        raise UserError(f"shapes '{recipe.data.shapes.use}' have no object in the split '{split}'")
    task = progress.add_task(f"building the {split} data", total=len(names)) if progress else None
    samples: list[Sample] = []
    rejected: dict[str, str] = {}
    for name, result in zip(names, _results(recipe, registry, names, jobs), strict=True):
        if isinstance(result, Sample):
            samples.append(result)
        else:
            rejected[name] = result
        if progress and task is not None:
            progress.advance(task)
    if not samples:
        reasons = "; ".join(f"{reason} ({count}x)" for reason, count in Counter(rejected.values()).most_common(3))
        raise UserError(f"none of the {len(names)} objects of the split '{split}' can be used: {reasons}")
    about = {
        "fingerprint": recipe.data_fingerprint,
        "split": split,
        "objects": len(samples),
        "rejected": rejected,
    }
    return Split.of(samples, about)


def _results(recipe: Recipe, registry: Registry, names: Sequence[str], jobs: int) -> Iterator[Sample | str]:
    """A sample for each name in their order, or the reason why there is none."""
    if jobs == 1 or len(names) < 2 * jobs:
        worker = _Worker(recipe, registry)
        yield from map(worker.make, names)
        return
    context = multiprocessing.get_context("spawn")
    files = tuple(registry.files)
    try:
        with ProcessPoolExecutor(jobs, context, _start, (recipe.resolved(), files)) as pool:
            yield from pool.map(_make, names, chunksize=4)
    except BrokenProcessPool as error:
        raise RunError(f"a process that was building data died ({error}): out of memory? try --jobs 1") from error


class _Worker:
    """What one process needs to make samples."""

    def __init__(self, recipe: Recipe, registry: Registry) -> None:
        self.recipe = recipe
        self.shapes: Shapes = recipe.data.shapes.build(registry, "shapes")
        self.source: TouchSource = recipe.data.touch.build(registry, "touch")

    def make(self, name: str) -> Sample | str:
        """One sample, or the reason why there is none: one bad object does not stop the others."""
        recipe = self.recipe
        try:
            item = self.shapes.item(name)
            return make_sample(item, self.source, recipe.data, recipe.most_touches, recipe.seed)
        except UserError as error:
            return str(error)


_worker: _Worker


def _start(recipe: dict[str, object], files: tuple[Path, ...]) -> None:
    from pcsr.recipe import from_resolved

    global _worker
    torch.set_num_threads(1)
    # Plugins given as files are loaded again here: their classes are not importable by name otherwise.
    registry = load_plugins(files)
    _worker = _Worker(from_resolved(recipe, registry), registry)


def _make(name: str) -> Sample | str:
    return _worker.make(name)
