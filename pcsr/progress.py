"""Progress of long tasks: bars on a terminal, lines in a log."""

from typing import Any

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)

from pcsr.errors import printable

LINES = 10
"""Largest number of lines that a log gets for each task."""
INTERVAL = 30.0
"""Seconds that pass at least between two lines of a task, other than its last."""


class _LoggedProgress(Progress):
    """Progress bars on a terminal; elsewhere a line at the end of each task, and some before if it is long."""

    def __init__(self, *columns: ProgressColumn, **options: Any) -> None:
        super().__init__(*columns, **options)
        self._logged: dict[TaskID, tuple[int, float]] = {}
        """Tenths that were done when a task was last logged, and the time then."""

    def add_task(self, description: str, *args: Any, **fields: Any) -> TaskID:
        """Add a task; its first line comes `INTERVAL` seconds later, unless it ends before."""
        task_id = super().add_task(printable(description, lines=False), *args, **fields)
        self._logged[task_id] = (0, self.get_time())
        return task_id

    def update(self, task_id: TaskID, **fields: Any) -> None:
        """Update a task, and log its progress if a line is due."""
        super().update(task_id, **fields)
        self._log(task_id)

    def advance(self, task_id: TaskID, advance: float | int = 1) -> None:
        """Advance a task, and log its progress if a line is due."""
        super().advance(task_id, advance)
        self._log(task_id)

    def stop(self) -> None:
        """Remove the bars; a log gets no empty line."""
        if self.console.is_terminal:
            super().stop()
        else:
            self.live.stop()

    def _log(self, task_id: TaskID) -> None:
        task = self._tasks[task_id]
        if self.console.is_terminal or self.disable or not task.total:
            return
        tenths, now = int(LINES * task.completed / task.total), self.get_time()
        before, then = self._logged[task_id]
        if tenths > before and (tenths >= LINES or now - then >= INTERVAL):
            self._logged[task_id] = (tenths, now)
            self.console.print(
                f"{task.description}: {task.completed:.0f} of {task.total:.0f}",
                markup=False,
                highlight=False,
                soft_wrap=True,
            )


def progress_bars(console: Console, hidden: bool) -> Progress:
    """Return progress bars for long tasks.

    Args:
        console: where to draw them; if it is no terminal, lines are printed instead, at most every tenth of a task and
            every `INTERVAL` seconds, and one at its end.
        hidden: whether to show nothing.
    """
    return _LoggedProgress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        disable=hidden,
        transient=True,
    )
