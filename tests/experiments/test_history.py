"""`metrics.jsonl`: it only grows, but for what came after a checkpoint that training goes on from."""

import json

import pytest

from pcsr import RunError
from pcsr.experiments.history import History


@pytest.fixture
def history(tmp_path):
    made = History(tmp_path / "metrics.jsonl")
    for step in (1, 2, 3):
        made.add({"step": step, "loss": 0.5 / step})
    return made


def steps(history):
    return [json.loads(line)["step"] for line in history.path.read_text().splitlines()]


def test_lines_are_added_at_the_end(history):
    assert steps(history) == [1, 2, 3]
    history.add({"step": 3, "validation": {"cd": 0.25}})
    assert json.loads(history.path.read_text().splitlines()[-1]) == {"step": 3, "validation": {"cd": 0.25}}


@pytest.mark.parametrize(("step", "kept"), [(0, []), (2, [1, 2]), (9, [1, 2, 3])])
def test_what_came_after_a_step_is_cut_off(history, step, kept):
    history.cut(step)
    assert steps(history) == kept
    assert list(history.path.parent.iterdir()) == [history.path]


@pytest.mark.parametrize("torn", [b'{"step": 4, "lo', b"\xff\xfe"])
def test_a_torn_line_and_what_follows_go_too(history, torn):
    with history.path.open("ab") as file:
        file.write(torn + b'\n{"step": 1}\n')
    history.cut(3)
    assert steps(history) == [1, 2, 3]


def test_without_a_file_there_is_nothing_to_cut(tmp_path):
    History(tmp_path / "none.jsonl").cut(3)
    assert list(tmp_path.iterdir()) == []


def test_a_line_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / "metrics.jsonl").mkdir()
    with pytest.raises(RunError, match=r"metrics\.jsonl could not be written: .*; free some space, run again"):
        History(tmp_path / "metrics.jsonl").add({"step": 1})
