"""Several runs on the same clouds, and the objects that all of them show."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pcsr.errors import UserError
from pcsr.results import Results
from pcsr.run_files import Cloud, Example, FinishedRun


@dataclass(frozen=True)
class SharedExample:
    """An object that every run shows."""

    example: Example
    """Its predictions are those of all runs: the networks first, in the order of the runs, then each baseline once."""
    touches: list[Cloud]
    """One cloud for each touch; empty where no run has touches."""


@dataclass(frozen=True)
class RunSet:
    """Several runs on the same clouds."""

    results: list[Results]
    networks: list[str]
    """Label of each run's own network; no two are equal."""
    histories: list[list[dict[str, Any]] | None]
    """Training history of each run, as `FinishedRun.history`."""
    examples: list[SharedExample]


def run_set(runs: Sequence[FinishedRun]) -> RunSet:
    """Join runs on the same clouds.

    Raises:
        UserError: there is no run, a run is given twice, the runs have no example in common, or their clouds differ.
    """
    if not runs:
        raise UserError("no run is named: name at least one run folder")
    twice = [folder for folder, count in Counter(run.folder.resolve() for run in runs).items() if count > 1]
    if twice:
        raise UserError(f"{twice[0]} is named twice: name each run once")
    by_name = [{one.name: one for one in run.examples} for run in runs]
    shared = [name for name in by_name[0] if all(name in examples for examples in by_name)]
    if not shared:
        where = ", ".join(str(run.folder) for run in runs)
        raise UserError(f"no object is an example of all of {where}: do `pcsr run` with evaluate.examples above 0")
    networks = _labels([run.results for run in runs])
    return RunSet(
        [run.results for run in runs],
        networks,
        [run.history for run in runs],
        [_shared_example([examples[name] for examples in by_name], runs, networks) for name in shared],
    )


def _labels(results: Sequence[Results]) -> list[str]:
    """Names of the runs; with the fingerprint where a name occurs twice."""
    counts = Counter(one.name for one in results)
    taken = {method.name for one in results for method in one.methods[1:]}
    return [one.folder_name if counts[one.name] > 1 or one.name in taken else one.name for one in results]


def _shared_example(examples: Sequence[Example], runs: Sequence[FinishedRun], networks: Sequence[str]) -> SharedExample:
    first = examples[0]
    for example, run in zip(examples[1:], runs[1:], strict=True):
        for what, one, other in (("input", first.input, example.input), ("truth", first.truth, example.truth)):
            if not np.array_equal(one, other):
                raise UserError(
                    f"{run.folder}: the {what} of '{first.name}' is not that of {runs[0].folder}: give both the same "
                    f"`data`, data.seed included"
                )
    predictions = {
        label: example.predictions[run.results.methods[0].name]
        for label, example, run in zip(networks, examples, runs, strict=True)
    }
    for example, run in zip(examples, runs, strict=True):
        for method in run.results.methods[1:]:
            predictions.setdefault(method.name, example.predictions[method.name])
    # Fewer touches are the first of more.
    touched, count = max(
        (
            (example.touches, run.results.data.touches if example.touch_count is None else example.touch_count)
            for example, run in zip(examples, runs, strict=True)
        ),
        key=lambda one: 0 if one[0] is None else len(one[0]),
    )
    touches: list[Cloud] = []
    if touched is not None:
        if count < 1 or len(touched) % count:
            raise UserError(f"{runs[0].folder}: {len(touched)} touched points are not those of {count} touches")
        touches = np.split(touched, count)
    return SharedExample(Example(first.name, first.input, touched, first.truth, predictions), touches)
