"""Conformance checks of parts, run in a separate process that is killed when a check exceeds its time limit."""

import multiprocessing
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pcsr.errors import RunError, UserError

if TYPE_CHECKING:
    from pcsr.contracts import ShapeItem
    from pcsr.plugins.registry import Registry
    from pcsr.testing import Check, Outcome

START_LIMIT = 120.0
"""Seconds within which the process must have loaded the parts."""


@dataclass(frozen=True)
class Job:
    """Picklable description of a part to check."""

    kind: str
    name: str
    options: dict[str, Any]
    mesh: Path | None = None
    """Mesh that a touch source is checked on."""
    upsampler: str | None = None
    """Name of the upsampler that an objective is checked with."""


def outcomes(jobs: Sequence[Job], files: Sequence[Path], limit: float) -> "Iterator[tuple[int, Outcome]]":
    """Run all checks of the parts. A check that exceeds its time limit or ends its process has failed.

    Args:
        jobs: the parts.
        files: plugin files to load.
        limit: seconds for each check.

    Yields:
        The index of the part in `jobs`, and the outcome of one of its checks.

    Raises:
        UserError: a part cannot be loaded.
        RunError: the process ended or hung before its first check.
    """
    from pcsr.testing import Outcome

    number, check, name = 0, 0, ""
    while True:
        begun = False
        with _process(jobs, files, (number, check)) as (process, answers):
            while True:
                if not answers.poll(limit if begun else START_LIMIT):
                    reason = f"it did not end within {limit:g} s: look for an endless loop, or raise --time-limit"
                    break
                try:
                    answer = answers.recv()
                except EOFError:
                    process.join()
                    reason = f"it ended its process with exit code {process.exitcode}: raise an error instead"
                    break
                if answer is None:
                    return
                if isinstance(answer, UserError):
                    raise answer
                if isinstance(answer, Outcome):
                    yield number, answer
                else:
                    number, check, name = answer
                    begun = True
        if not begun:
            raise RunError(f"the process that runs the checks ended or hung before the first check: {reason}")
        yield number, Outcome(name, "failed", f"{jobs[number].kind} '{jobs[number].name}': {reason}")
        check += 1


@contextmanager
def _process(
    jobs: Sequence[Job], files: Sequence[Path], start: tuple[int, int]
) -> Iterator[tuple[BaseProcess, Connection]]:
    """Start a process that runs all checks from `start` (index of a part, index of a check) on; kill it at the end."""
    context = multiprocessing.get_context("spawn")
    answers, sender = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(tuple(jobs), tuple(files), start, sender), daemon=True)
    process.start()
    sender.close()  # so that the pipe ends when the process, which holds a copy, ends
    try:
        yield process, answers
    finally:
        process.kill()
        process.join()
        answers.close()


def _work(jobs: Sequence[Job], files: Sequence[Path], start: tuple[int, int], answers: Connection) -> None:
    """Run the checks; send the indices and name of each before it, its outcome after it, and None at the end."""
    from pcsr.plugins.loading import load_plugins
    from pcsr.workers import end_with_parent

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent process ends this one
    end_with_parent()
    try:
        registry = load_plugins(files, files_win=True)
        for part in range(start[0], len(jobs)):
            checks = _checks(jobs[part], registry)
            for number in range(start[1] if part == start[0] else 0, len(checks)):
                answers.send((part, number, checks[number].name))
                answers.send(checks[number].outcome())
    except UserError as error:
        answers.send(error)
    else:
        answers.send(None)


def _checks(job: Job, registry: "Registry") -> "list[Check]":
    from pcsr.testing import checks_for

    host: dict[str, Any] = {}
    if job.mesh is not None:
        host["item"] = item(job.mesh)
    if job.upsampler is not None:
        host["upsampler"] = registry.get("upsampler", job.upsampler)
    return checks_for(registry.get(job.kind, job.name), **host, **job.options)


def item(mesh: Path) -> "ShapeItem":
    """Return the object that a touch source is checked on.

    Raises:
        UserError: the file is not a mesh.
    """
    from pcsr.clouds.meshes import read_mesh
    from pcsr.contracts import ShapeItem

    if not mesh.is_file():
        raise UserError(f"--mesh {mesh}: {'that is a folder' if mesh.is_dir() else 'there is no such file'}")
    return ShapeItem(mesh.name, mesh.name, read_mesh(mesh))
