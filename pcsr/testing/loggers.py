"""Checks of loggers, with the values of a short training."""

import copy
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from pcsr.contracts import Logger
from pcsr.testing.subject import Subject

RECIPE: dict[str, Any] = {"name": "check", "seed": 0, "train": {"epochs": 2, "loggers": [{"use": "jsonl"}]}}
"""A part of a resolved recipe."""
STEPS = 4
"""Steps of the training, of which two are an epoch."""


def values(step: int) -> list[dict[str, int | float]]:
    """What a training logs after a step: its values, and a validation at the end of an epoch."""
    epoch = step // 2
    losses = {"loss": 0.75 / step, "loss/near": 0.5 / step, "loss/far": 0.25 / step}
    of_step = {"epoch": epoch, **losses, "learning_rate": 1e-3, "gradient_norm": 2.0, "seconds": 0.5, "threads": 1}
    return [of_step, *([{"epoch": epoch, "validation/cd": 0.5 / step}] if step % 2 == 0 else [])]


def logs(subject: Subject) -> None:
    """It records a training from the first step to the last, and finishes."""
    _in_folder(lambda folder: _train(subject.built(), folder, 0, STEPS, completed=True))


def resumes(subject: Subject) -> None:
    """Another instance goes on after an earlier step in the same folder, and logs the steps since then again."""

    def run(folder: Path) -> None:
        _train(subject.built(), folder, 0, STEPS - 1, completed=False)
        _train(subject.built(seed=1), folder, STEPS - 2, STEPS, completed=True)

    _in_folder(run)


def interrupted(subject: Subject) -> None:
    """It finishes without a step, as in a training that is interrupted at once."""
    _in_folder(lambda folder: _train(subject.built(), folder, 0, 0, completed=False))


def leaves_values(subject: Subject) -> None:
    """It does not change the recipe and the values that it is given."""
    logger, recipe, given = subject.built(), copy.deepcopy(RECIPE), values(2)

    def run(folder: Path) -> None:
        logger.start(folder, recipe, 0)
        for one in given:
            logger.log(2, one)
        logger.finish(True)

    _in_folder(run)
    if recipe != RECIPE or given != values(2):
        raise subject.failure("it changes what it is given", "that it only reads it", "work on a copy")


def leaves_random_numbers(subject: Subject) -> None:
    """It draws none of the random numbers that training may draw."""
    before = _random_state()
    _in_folder(lambda folder: _train(subject.built(), folder, 0, STEPS, completed=True))
    if _random_state() != before:
        raise subject.failure(
            "it draws random numbers from a generator of the process",
            "that training is the same with and without it",
            "draw from a generator of its own: numpy.random.default_rng()",
        )


def _train(logger: Logger, folder: Path, start: int, end: int, *, completed: bool) -> None:
    logger.start(folder, copy.deepcopy(RECIPE), start)
    for step in range(start + 1, end + 1):
        for one in values(step):
            logger.log(step, one)
    logger.finish(completed)


def _in_folder(run: Callable[[Path], None]) -> None:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        run(Path(folder))


def _random_state() -> tuple[object, ...]:
    return torch.get_rng_state().tolist(), str(np.random.get_state())  # noqa: NPY002 only its state is read
