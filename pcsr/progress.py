"""Progress of long tasks: bars on a terminal, lines in a log."""

from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

LINES = 10
"""Number of lines that a log gets for each task."""


class _LoggedProgress(Progress):
    """Progress bars on a terminal; elsewhere a line after each tenth of a task."""

    def update(self, task_id: TaskID, **fields: Any) -> None:
        """Update a task, and log its progress if another tenth is done."""
        before = self._tenths(task_id)
        super().update(task_id, **fields)
        self._log(task_id, before)

    def advance(self, task_id: TaskID, advance: float | int = 1) -> None:
        """Advance a task, and log its progress if another tenth is done."""
        before = self._tenths(task_id)
        super().advance(task_id, advance)
        self._log(task_id, before)

    def _tenths(self, task_id: TaskID) -> int:
        task = self._tasks[task_id]
        return int(LINES * task.completed / task.total) if task.total else 0

    def _log(self, task_id: TaskID, before: int) -> None:
        task = self._tasks[task_id]
        if not self.console.is_terminal and not self.disable and self._tenths(task_id) > before:
            self.console.print(
                f"{task.description}: {task.completed:.0f} of {task.total:.0f}", markup=False, highlight=False
            )


def progress_bars(console: Console, hidden: bool) -> Progress:
    """Return progress bars for long tasks.

    Args:
        console: where to draw them; lines are printed instead if it is no terminal.
        hidden: whether to show nothing.
    """
    return _LoggedProgress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        disable=hidden,
        transient=True,
    )
