"""The logger `jsonl`: `metrics.jsonl` only grows, but for what came after a checkpoint that training goes on from."""

import json

import pytest

from pcsr import RunError
from pcsr.experiments.history import JsonLines
from pcsr.run_files import read_history

STEP = {"epoch": 0, "loss": 0.5, "loss/near": 0.2, "loss/far": 0.3, "learning_rate": 1e-3, "seconds": 1.5, "threads": 2}


def logger(folder, step=0):
    made = JsonLines()
    made.start(folder, {}, step)
    return made


@pytest.fixture
def history(tmp_path):
    made = logger(tmp_path)
    for step in (1, 2, 3):
        made.log(step, STEP)
    return made


def steps(history):
    return [json.loads(line)["step"] for line in history.path.read_text().splitlines()]


def test_a_step_is_a_line_and_so_is_a_validation(history):
    history.log(3, {"epoch": 1, "validation/cd": 0.25})
    *_, step, validation = history.path.read_text().splitlines()
    assert step == (
        '{"step": 3, "epoch": 0, "loss": 0.5, "losses": {"near": 0.2, "far": 0.3}, "rate": 0.001, "seconds": 1.5, '
        '"threads": 2}'
    )
    assert validation == '{"epoch": 1, "step": 3, "validation": {"cd": 0.25}}'
    assert len(read_history(history.path)) == 4


def test_the_norm_of_the_gradient_is_written_where_it_is_logged(history):
    history.log(4, {**STEP, "gradient_norm": 2.5})
    assert read_history(history.path)[-1]["gradient_norm"] == 2.5


@pytest.mark.parametrize(("step", "kept"), [(0, []), (2, [1, 2]), (9, [1, 2, 3])])
def test_what_came_after_a_step_is_cut_off(history, tmp_path, step, kept):
    assert steps(logger(tmp_path, step)) == kept
    assert list(tmp_path.iterdir()) == [history.path]


@pytest.mark.parametrize("torn", [b'{"step": 4, "lo', b"\xff\xfe", b"{}", b"[]", b"7", b'{"step": "x"}'])
def test_a_torn_line_and_what_follows_go_too(history, tmp_path, torn):
    with history.path.open("ab") as file:
        file.write(torn + b'\n{"step": 1}\n')
    assert steps(logger(tmp_path, 3)) == [1, 2, 3]


def test_without_a_file_there_is_nothing_to_cut(tmp_path):
    logger(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_line_that_cannot_be_written_is_said(tmp_path):
    made = logger(tmp_path)
    (tmp_path / "metrics.jsonl").mkdir()
    with pytest.raises(RunError, match=r"metrics\.jsonl could not be written: "):
        made.log(1, STEP)


def test_after_a_full_disk_the_file_still_consists_of_whole_lines(history, monkeypatch):
    class Full:
        def __init__(self, file):
            self.file = file

        def __enter__(self):
            return self

        def __exit__(self, *error):
            self.file.close()

        def write(self, text):
            self.file.write(text[:9])
            raise OSError(28, "No space left on device")

    opened = type(history.path).open
    with monkeypatch.context() as patched:
        patched.setattr(type(history.path), "open", lambda path, *how, **more: Full(opened(path, *how, **more)))
        with pytest.raises(RunError, match="No space left on device"):
            history.log(4, STEP)
    history.log(5, STEP)
    assert [line["step"] for line in read_history(history.path)] == [1, 2, 3, 5]
