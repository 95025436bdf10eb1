"""The loggers of a training run, whose errors do not end the training."""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pcsr.contracts import Logger
from pcsr.errors import PcsrWarning
from pcsr.plugins.guard import guarded
from pcsr.plugins.registry import Registry, described
from pcsr.recipe import PartSpec, Recipe

END = "at its end"


@dataclass(eq=False)
class _Entry:
    """Logger with its name and whether it has raised an error."""

    name: str
    logger: Logger
    failed: bool = False


class Loggers:
    """The loggers of a run. The first error of each becomes a warning, and later ones are ignored."""

    def __init__(self, specs: Sequence[PartSpec], registry: Registry) -> None:
        """Build the loggers. Errors of their constructors are raised, since nothing has been trained yet."""
        self.entries = [_Entry(spec.use, spec.build(registry, "logger")) for spec in specs]

    @contextmanager
    def running(self, folder: Path, recipe: Recipe, step: int) -> Iterator[None]:
        """Start the loggers, and finish them however the context ends. One that fails to start is not called again.

        Args:
            folder: run folder.
            recipe: recipe of the run.
            step: number of steps already done.

        Warns:
            PcsrWarning: a logger raised an error.
        """
        self._call_each(lambda entry: entry.logger.start(folder, recipe.resolved(), step), "at its start")
        self.entries = [entry for entry in self.entries if not entry.failed]
        completed = False
        try:
            yield
            completed = True
        finally:
            self._call_each(lambda entry: entry.logger.finish(completed), END)

    def log(self, step: int, values: Mapping[str, int | float]) -> None:
        """Log values after a step.

        Warns:
            PcsrWarning: a logger raised its first error.
        """
        self._call_each(lambda entry: entry.logger.log(step, dict(values)), f"at step {step}")

    def _call_each(self, call: Callable[[_Entry], None], when: str) -> None:
        for entry in self.entries:
            try:
                with guarded(f"logger '{entry.name}'"):
                    call(entry)
            except (Exception, SystemExit) as error:
                if not entry.failed:
                    text = f"logger '{entry.name}' failed {when}: {described(error)}"
                    if when != END:
                        text += "; training goes on, and further errors of this logger are not shown"
                    warnings.warn(text, PcsrWarning, stacklevel=4)
                entry.failed = True
