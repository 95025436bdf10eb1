"""Progress: bars on a terminal, a line for each tenth in a log, nothing where it is hidden."""

import io

import pytest
from rich.console import Console

from pcsr.progress import progress_bars


def log(steps, *, hidden=False, terminal=False, total=40):
    text = io.StringIO()
    with progress_bars(Console(file=text, force_terminal=terminal, width=80), hidden=hidden) as progress:
        task = progress.add_task("working", total=total)
        for step in steps:
            progress.advance(task, step)
    return [line for line in text.getvalue().splitlines() if line.startswith("working: ")]


def test_a_log_gets_a_line_for_each_tenth():
    assert log([1] * 40) == [f"working: {4 * k} of 40" for k in range(1, 11)]


def test_steps_that_skip_tenths_get_one_line_each():
    assert log([25, 15]) == ["working: 25 of 40", "working: 40 of 40"]


@pytest.mark.parametrize("options", [{"hidden": True}, {"terminal": True}])
def test_a_terminal_has_its_bar_and_what_is_hidden_is_silent(options):
    assert log([1] * 40, **options) == []


def test_updates_count_too_and_a_total_that_comes_later():
    text = io.StringIO()
    with progress_bars(Console(file=text), hidden=False) as progress:
        task = progress.add_task("training", total=None)
        progress.advance(task)
        for done in (10, 11, 20):
            progress.update(task, total=20, completed=done, description="training, loss 1")
    assert "training, loss 1: 10 of 20" in text.getvalue()
    assert "11 of 20" not in text.getvalue()
