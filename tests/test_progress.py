"""Progress: bars on a terminal, few lines in a log, nothing where it is hidden."""

import io
import itertools

import pytest
from rich.console import Console

from pcsr.progress import INTERVAL, progress_bars


def log(steps, *, seconds=0.0, hidden=False, terminal=False, total=40):
    """The lines of a task, each of whose steps takes so many seconds."""
    text, clock = io.StringIO(), itertools.count()
    with progress_bars(Console(file=text, force_terminal=terminal, width=80), hidden=hidden) as progress:
        now = [0.0]
        progress.get_time = lambda: now[0]
        task = progress.add_task("working", total=total)
        for step in steps:
            now[0] = seconds * (next(clock) + 1)
            progress.advance(task, step)
    printed = text.getvalue().splitlines()
    return [line for line in printed if line.startswith("working: ")] if terminal else printed


def test_a_short_task_gets_one_line_at_its_end():
    assert log([1] * 40, seconds=INTERVAL / 41) == ["working: 40 of 40"]


def test_a_long_task_gets_a_line_for_each_tenth():
    assert log([1] * 40, seconds=INTERVAL) == [f"working: {4 * k} of 40" for k in range(1, 11)]


def test_between_two_lines_time_passes():
    # 40 steps in 4 intervals: a line every tenth step, though a tenth is done every fourth.
    assert log([1] * 40, seconds=INTERVAL / 10) == [f"working: {k} of 40" for k in (10, 20, 30, 40)]


def test_a_task_that_goes_on_after_its_end_gets_no_further_line():
    assert log([40, 0, 0], seconds=INTERVAL) == ["working: 40 of 40"]


def test_a_long_description_is_one_line():
    text = io.StringIO()
    with progress_bars(Console(file=text, width=20), hidden=False) as progress:
        progress.advance(progress.add_task("training [net] " * 9, total=1))
    assert text.getvalue() == "training [net] " * 9 + ": 1 of 1\n"


@pytest.mark.parametrize("options", [{"hidden": True}, {"terminal": True}])
def test_a_terminal_has_its_bar_and_what_is_hidden_is_silent(options):
    assert log([1] * 40, **options) == []


def test_updates_count_too_and_a_total_that_comes_later():
    text = io.StringIO()
    with progress_bars(Console(file=text), hidden=False) as progress:
        task = progress.add_task("training", total=None)
        progress.advance(task)
        for done in (10, 11, 20):
            progress.update(task, total=20, completed=done, description=f"training, loss {done}")
    assert text.getvalue() == "training, loss 20: 20 of 20\n"
