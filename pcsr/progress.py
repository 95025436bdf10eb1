"""Progress of long work: bars on a terminal, a line now and then in a log."""

from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeRemainingColumn

STEPS = 10
"""A log gets so many lines for each task."""


class _Logged(Progress):
    """Bars, or lines where nobody could see a bar move."""

    def update(self, task_id: TaskID, **fields: Any) -> None:
        """As rich has it; in a log, a line whenever another tenth is done."""
        before = self._tenths(task_id)
        super().update(task_id, **fields)
        self._tell(task_id, before)

    def advance(self, task_id: TaskID, advance: float | int = 1) -> None:
        """As rich has it; in a log, a line whenever another tenth is done."""
        before = self._tenths(task_id)
        super().advance(task_id, advance)
        self._tell(task_id, before)

    def _tenths(self, task_id: TaskID) -> int:
        task = self._tasks[task_id]
        return int(STEPS * task.completed / task.total) if task.total else 0

    def _tell(self, task_id: TaskID, before: int) -> None:
        task = self._tasks[task_id]
        if not self.console.is_terminal and not self.disable and self._tenths(task_id) > before:
            self.console.print(
                f"{task.description}: {task.completed:.0f} of {task.total:.0f}", markup=False, highlight=False
            )


def progress_bars(console: Console, hidden: bool) -> Progress:
    """Bars for long work."""
    return _Logged(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        disable=hidden,
        transient=True,
    )
