"""The runs whose clouds can stand side by side, and the objects that all of them show."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pcsr.errors import UserError
from pcsr.report.comparison import folder_of
from pcsr.report.results import Cloud, Example, Results, read_examples, read_history, read_results


@dataclass(frozen=True)
class Subject:
    """An object as every run shows it."""

    example: Example
    """Its predictions are those of every run: the networks first, in the order of the runs, then each baseline once."""
    touches: list[Cloud]
    """One by one; none where no run has any."""


@dataclass(frozen=True)
class Gathered:
    """Several run folders, read."""

    runs: list[Results]
    networks: list[str]
    """What the runs' own networks are called, each name once."""
    histories: list[list[dict[str, Any]] | None]
    """As `read_history` gives them."""
    subjects: list[Subject]


def gather(folders: Sequence[Path]) -> Gathered:
    """Read run folders of the same clouds.

    Args:
        folders: at least one, each with `results.json` and `examples.safetensors`, and `metrics.jsonl` if it trained.

    Raises:
        UserError: a file is missing or malformed, a run is named twice, the runs have no example in common, or theirs
            are of different clouds.
    """
    if not folders:
        raise UserError("no run is named: name at least one run folder")
    twice = [folder for folder, count in Counter(map(Path.resolve, folders)).items() if count > 1]
    if twice:
        raise UserError(f"{twice[0]} is named twice: name each run once")
    runs = [read_results(folder / "results.json") for folder in folders]
    examples = [
        {one.name: one for one in read_examples(folder / "examples.safetensors", [m.name for m in run.methods])}
        for folder, run in zip(folders, runs, strict=True)
    ]
    shared = [name for name in examples[0] if all(name in of_run for of_run in examples)]
    if not shared:
        where = ", ".join(map(str, folders))
        raise UserError(f"no object is an example of all of {where}: do `pcsr run` with evaluate.examples above 0")
    networks = _labels(runs)
    subjects = [_subject([of_run[name] for of_run in examples], runs, networks, folders) for name in shared]
    return Gathered(runs, networks, [read_history(folder / "metrics.jsonl") for folder in folders], subjects)


def _labels(runs: Sequence[Results]) -> list[str]:
    """The runs' names; where two have the same, with what else tells them apart."""
    counts = Counter(run.name for run in runs)
    taken = {method.name for run in runs for method in run.methods[1:]}
    return [folder_of(run) if counts[run.name] > 1 or run.name in taken else run.name for run in runs]


def _subject(
    examples: Sequence[Example], runs: Sequence[Results], networks: Sequence[str], folders: Sequence[Path]
) -> Subject:
    first = examples[0]
    for example, folder in zip(examples[1:], folders[1:], strict=True):
        for what, one, other in (("input", first.input, example.input), ("truth", first.truth, example.truth)):
            if not np.array_equal(one, other):
                raise UserError(
                    f"{folder}: the {what} of '{first.name}' is not that of {folders[0]}: give both the same `data`, "
                    f"data.seed included"
                )
    predictions = {
        label: example.predictions[run.methods[0].name]
        for label, example, run in zip(networks, examples, runs, strict=True)
    }
    for example, run in zip(examples, runs, strict=True):
        for method in run.methods[1:]:
            predictions.setdefault(method.name, example.predictions[method.name])
    # Fewer touches are the first of more.
    touched, count = max(
        ((example.touches, run.data.touches) for example, run in zip(examples, runs, strict=True)),
        key=lambda one: 0 if one[0] is None else len(one[0]),
    )
    touches: list[Cloud] = []
    if touched is not None:
        if count < 1 or len(touched) % count:
            raise UserError(f"{folders[0]}: {len(touched)} touched points are not those of {count} touches")
        touches = np.split(touched, count)
    return Subject(Example(first.name, first.input, touched, first.truth, predictions), touches)
