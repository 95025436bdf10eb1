"""The checks of parts in a process of their own, which is ended where one of them runs on."""

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

STARTING = 120.0
"""Seconds that the process has to load the parts; the command has loaded them once already."""


@dataclass(frozen=True)
class Job:
    """A part to be checked, in a form that another process can be handed."""

    kind: str
    name: str
    options: dict[str, Any]
    mesh: Path | None = None
    """What a touch source is to touch."""
    upsampler: str | None = None
    """What an objective is made for."""


def outcomes(jobs: Sequence[Job], files: Sequence[Path], limit: float) -> "Iterator[tuple[int, Outcome]]":
    """What comes of each check of parts; one that does not end, or ends its process, has failed.

    Args:
        jobs: the parts.
        files: the plugin files to be loaded.
        limit: seconds for each check.

    Yields:
        The number of the part, and what came of one of its checks.

    Raises:
        UserError: a part cannot be loaded.
    """
    from pcsr.testing import Outcome

    number, check, name = 0, 0, ""
    while True:
        begun = False
        with _process(jobs, files, (number, check)) as (process, answers):
            while True:
                if not answers.poll(limit if begun else STARTING):
                    said = f"it did not end within {limit:g} s: look for an endless loop; --time-limit gives it longer"
                    break
                try:
                    answer = answers.recv()
                except EOFError:
                    process.join()
                    said = f"it ended its process, with the exit code {process.exitcode}: raise an error instead"
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
            raise RunError(f"the process that runs the checks ended or hung before the first of them: {said}")
        yield number, Outcome(name, "failed", f"{jobs[number].kind} '{jobs[number].name}': {said}")
        check += 1


@contextmanager
def _process(
    jobs: Sequence[Job], files: Sequence[Path], start: tuple[int, int]
) -> Iterator[tuple[BaseProcess, Connection]]:
    """A process at work on all checks from `start` on, the numbers of a part and a check; it ends with the context."""
    context = multiprocessing.get_context("spawn")
    answers, theirs = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(tuple(jobs), tuple(files), start, theirs), daemon=True)
    process.start()
    theirs.close()  # the process has its own, and with that one the pipe ends
    try:
        yield process, answers
    finally:
        process.kill()
        process.join()
        answers.close()


def _work(jobs: Sequence[Job], files: Sequence[Path], start: tuple[int, int], answers: Connection) -> None:
    """Run the checks: before each its numbers and name are sent, after it what came of it, and at the end None."""
    from pcsr.plugins.loading import load_plugins
    from pcsr.workers import end_with_parent

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started this process ends it
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
    """What a touch source is to touch.

    Raises:
        UserError: the file is no mesh.
    """
    from pcsr.clouds.meshes import read_mesh
    from pcsr.contracts import ShapeItem

    if not mesh.is_file():
        raise UserError(f"--mesh {mesh}: {'that is a folder' if mesh.is_dir() else 'there is no such file'}")
    return ShapeItem(mesh.name, mesh.name, read_mesh(mesh))
