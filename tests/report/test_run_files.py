"""The files of a run folder, read back as they were written."""

from dataclasses import replace

import numpy as np
import pytest
from safetensors.numpy import save_file

from pcsr.errors import UserError
from pcsr.run_files import read_examples, read_history, read_run, write_run


def test_a_run_is_read_as_it_was_written(run, results, history, tmp_path):
    first = read_run(run)
    assert first.folder == run
    assert first.results.name == "tapsr"
    assert first.history == history
    assert [example.name for example in first.examples] == results["objects"][:2]
    copied = replace(first, folder=tmp_path / "copy")
    write_run(copied)
    second = read_run(tmp_path / "copy")
    assert second.results == first.results
    assert second.history is None
    for one, other in zip(first.examples, second.examples, strict=True):
        np.testing.assert_array_equal(one.touches, other.touches)
        for method, cloud in one.predictions.items():
            np.testing.assert_array_equal(other.predictions[method], cloud)
    assert (tmp_path / "copy" / "examples.safetensors").stat().st_size > 0


def test_history_is_read_and_absence_is_none(run, history):
    assert read_history(run / "metrics.jsonl") == history
    assert read_history(run / "none.jsonl") is None


@pytest.mark.parametrize(
    "line",
    [
        "{",
        "[]",
        '{"loss": 1}',
        '{"step": 1}',
        '{"step": 1, "loss": "low"}',
        '{"step": 1, "loss": NaN}',
        '{"step": 1, "loss": 1, "losses": 2}',
        '{"step": 1, "validation": 1}',
    ],
)
def test_a_malformed_line_is_named_by_number(run, line):
    with (run / "metrics.jsonl").open("a", encoding="utf-8") as file:
        file.write(line + "\n")
    with pytest.raises(UserError, match=r"metrics\.jsonl:32: .*do `pcsr run` again"):
        read_history(run / "metrics.jsonl")


def test_examples_are_read_as_they_were_saved(run, clouds):
    first, second = read_examples(run / "examples.safetensors", ["tapsr", "midpoint"])
    assert second.name == "test/gear/0001"
    assert list(first.predictions) == ["tapsr", "midpoint"]
    np.testing.assert_array_equal(first.touches, clouds["0/touches"])
    np.testing.assert_array_equal(second.predictions["midpoint"], clouds["1/midpoint"])


@pytest.mark.parametrize(
    ("key", "cloud", "named"),
    [
        ("0/tapsr", None, "0/tapsr"),
        ("1/truth", np.full((4, 3), np.nan, np.float32), "1/truth"),
        ("1/input", np.zeros((4, 2), np.float32), "1/input"),
        ("1/input", np.zeros((0, 3), np.float32), "1/input"),
    ],
)
def test_a_missing_or_unusable_cloud_is_named(tmp_path, clouds, key, cloud, named):
    clouds = {k: c for k, c in {**clouds, key: cloud}.items() if c is not None}
    save_file(clouds, tmp_path / "e.safetensors", {"names": '["a", "b"]'})
    with pytest.raises(UserError, match=f"e.safetensors.*{named}.*do `pcsr run` again"):
        read_examples(tmp_path / "e.safetensors", ["tapsr"])


def test_files_that_are_no_examples_are_named(tmp_path, clouds):
    file = tmp_path / "e.safetensors"
    with pytest.raises(UserError, match=r"e\.safetensors is missing"):
        read_examples(file, [])
    file.write_bytes(b"not tensors")
    with pytest.raises(UserError, match=r"e\.safetensors is no file of examples"):
        read_examples(file, [])
    save_file(clouds, file)  # without names
    with pytest.raises(UserError, match=r"e\.safetensors is no file of examples"):
        read_examples(file, [])
