"""Files of a finished run: its results, a few clouds to look at, and the history of its training."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from safetensors import SafetensorError, safe_open

from pcsr.errors import UserError
from pcsr.files import save_tensors
from pcsr.results import RERUN, Results, read_object, read_results, read_text, write_results
from pcsr.weights import WEIGHTS

Cloud = Float[np.ndarray, "_ 3"]
RESULTS, EXAMPLES, HISTORY = "results.json", "examples.safetensors", "metrics.jsonl"
RECIPE, ENVIRONMENT, CHECKPOINT = "recipe.json", "environment.json", "checkpoint.safetensors"
REPORT = "report.html"
KNOWN_BY = (RESULTS, RECIPE, WEIGHTS, CHECKPOINT, HISTORY, EXAMPLES)
"""Names of the files by which run folders are known."""
PLUGINS = "plugins"
"""Folder, within a run folder, of the copies of plugin files."""


def snapshot_file(step: int) -> str:
    """Return the name of the weights file that a run keeps after a step of `train.snapshots`."""
    return f"weights-{step}.safetensors"


@dataclass(frozen=True)
class Example:
    """The clouds of one object, in one frame."""

    name: str
    input: Cloud
    touches: Cloud | None
    """The touched points of all touches; None where there are no touches."""
    truth: Cloud
    predictions: dict[str, Cloud]
    """The dense cloud of each method, by the method's name."""
    touch_count: int | None = None
    """Number of touches; None: as many as the run has, as in files of pcsr before 0.3."""


@dataclass(frozen=True)
class FinishedRun:
    """Content of a run folder."""

    folder: Path
    """Where the run is kept; messages name it, and the report is written there."""
    results: Results
    examples: list[Example]
    history: list[dict[str, Any]] | None
    """Lines of the training history; None if the weights were trained elsewhere."""


def read_run(folder: Path) -> FinishedRun:
    """Read a run folder: `results.json`, `examples.safetensors`, and `metrics.jsonl` if the run trained.

    Raises:
        UserError: a file is missing or malformed.
    """
    results = read_results(folder / RESULTS)
    examples = read_examples(folder / EXAMPLES, [method.name for method in results.methods])
    return FinishedRun(folder, results, examples, read_history(folder / HISTORY))


def read_results_of(folder: Path) -> FinishedRun:
    """Read a run folder as `read_run`, or its results alone, without examples and history, where those are missing.

    Raises:
        UserError: the run is not finished, or its results are malformed.
    """
    if not (folder / RESULTS).exists():
        raise UserError(f"{folder} is not finished: it has no {RESULTS}; do `pcsr run` again")
    try:
        return read_run(folder)
    except UserError:
        return FinishedRun(folder, read_results(folder / RESULTS), [], None)


def is_run_folder(folder: Path) -> bool:
    """Whether a folder holds a file by which run folders are known."""
    return any((folder / name).is_file() for name in KNOWN_BY)


def is_file_of_run(path: Path) -> bool:
    """Whether a path is that of a file by which run folders are known, in such a folder."""
    return path.name in KNOWN_BY and path.is_file()


def check_run_folder(folder: Path) -> None:
    """Check that a folder is a run folder.

    Raises:
        UserError: it does not exist, or holds none of the files of a run.
    """
    if not is_run_folder(folder):
        raise UserError(f"{folder} is no run folder: name one that `pcsr run` has written")


def read_environment(folder: Path) -> dict[str, dict[str, Any]]:
    """Read the environments of a run's stages, "training" and "evaluation"; empty in run folders of pcsr before 0.3.

    Raises:
        UserError: the file is malformed.
    """
    path = folder / ENVIRONMENT
    if not path.exists():
        return {}
    stages = read_object(path)
    if not all(isinstance(about, dict) for about in stages.values()):
        raise UserError(f"{path} is not an object of stages; {RERUN}")
    for stage, about in stages.items():
        git = about.get("git", [])
        if not isinstance(git, list) or not all(isinstance(one, dict) for one in git):
            raise UserError(f"{path}: {stage}.git is not a list of objects; {RERUN}")
        if not isinstance(about.get("plugins", {}), dict):
            raise UserError(f"{path}: {stage}.plugins is not an object; {RERUN}")
    return stages


def write_run(run: FinishedRun) -> None:
    """Write the results and the examples of a run into its folder, each file whole or not at all.

    Raises:
        RunError: a file can't be written.
    """
    tensors: dict[str, torch.Tensor] = {}
    for k, example in enumerate(run.examples):
        clouds = {"input": example.input, "truth": example.truth, "touches": example.touches, **example.predictions}
        tensors |= {f"{k}/{key}": torch.from_numpy(cloud) for key, cloud in clouds.items() if cloud is not None}
    about = {
        "names": json.dumps([example.name for example in run.examples]),
        "touches": json.dumps([example.touch_count for example in run.examples]),
    }
    save_tensors(run.folder / EXAMPLES, tensors, about)
    write_results(run.folder / RESULTS, run.results)


def read_history(path: Path) -> list[dict[str, Any]] | None:
    """Read `metrics.jsonl`; None if there is none, as for weights that were trained elsewhere.

    Raises:
        UserError: a line is malformed.
    """
    if not path.exists():
        return None
    history = []
    for number, line in enumerate(read_text(path).splitlines(), 1):
        try:
            entry = json.loads(line)
            step = entry["step"]
            numbers = [step, *([entry["loss"]] if "validation" not in entry else entry["validation"].values())]
            if not all(math.isfinite(number) for number in (*numbers, *entry.get("losses", {}).values())):
                raise ValueError("not finite")
        except (ValueError, AttributeError, KeyError, TypeError, RecursionError) as error:
            raise UserError(f"{path}:{number}: not a line of a training history; {RERUN}") from error
        history.append(entry)
    return history


def read_examples(path: Path, methods: Sequence[str]) -> list[Example]:
    """Read `examples.safetensors`.

    Raises:
        UserError: the file is missing or malformed, or lacks a cloud.
    """
    if not path.is_file():
        raise UserError(f"{path} is missing; {RERUN}")
    try:
        with safe_open(path, framework="numpy") as file:
            names = json.loads(file.metadata()["names"])
            counts = json.loads(file.metadata().get("touches", "null")) or [None] * len(names)
            clouds = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 (not a dict)
        for key, cloud in clouds.items():
            if cloud.ndim != 2 or cloud.shape[1] != 3 or not len(cloud) or not np.isfinite(cloud).all():
                raise ValueError(f"{key} of shape {cloud.shape} is no cloud of finite points")
        return [
            Example(
                name,
                clouds[f"{k}/input"],
                clouds.get(f"{k}/touches"),
                clouds[f"{k}/truth"],
                {method: clouds[f"{k}/{method}"] for method in methods},
                count if count is None else int(count),
            )
            for k, (name, count) in enumerate(zip(names, counts, strict=True))
        ]
    except KeyError as error:
        raise UserError(f"{path} lacks {error}; {RERUN}") from error
    except (SafetensorError, OSError, TypeError, ValueError) as error:
        raise UserError(f"{path} is no file of examples: {error}; {RERUN}") from error
