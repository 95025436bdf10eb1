"""Options that several commands share: folders to write to, and completion of values."""

import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner

from pcsr.cli import pcsr

WRITING = {
    "run": ("run", "recipe.yaml", "--runs"),
    "compare": ("compare", "recipe.yaml", "--runs"),
    "touch": ("touch", "part.stl", "-o"),
    "data make": ("data", "make", "cad-parts", "-o"),
    "figures": ("figures", "run", "-o"),
}


@pytest.mark.parametrize("command", WRITING)
@pytest.mark.parametrize("below", [(), ("below",), ("below", "it")])
def test_a_file_is_no_folder_to_write_to(command, below, tmp_path):
    file = tmp_path / "file"
    file.touch()
    done = CliRunner().invoke(pcsr, [*WRITING[command], str(file.joinpath(*below))])
    assert done.exit_code == 2
    assert f"'{file}' is a file: name a folder" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_a_link_to_nothing_is_no_folder_to_write_to(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    done = CliRunner().invoke(pcsr, [*WRITING["touch"], str(tmp_path / "link")])
    assert (done.exit_code, "name a folder" in done.stderr) == (2, True)


def test_empty_shapes_do_not_mean_the_current_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(pcsr, ["data", "make", "", "-o", "data"])
    assert (done.exit_code, "SHAPES is empty" in done.stderr) == (2, True)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("words", "incomplete", "expected"),
    [
        (["compare", "recipe.yaml", "--fusion"], "iter", ["iterative"]),
        (["export"], "fra", ["frames"]),
        (["export"], "runs/", ["runs/"]),
        (["evaluate", "a.ply", "b.ply", "--metric"], "hd-", ["hd-pugcn"]),
        (["touch", "part.stl", "--source"], "dig", ["digit"]),
        (["touch", "part.stl", "--sensor"], "gelsight-m", ["gelsight-mini"]),
        (["touch", "part.stl", "--policy"], "sp", ["sparse", "spread"]),
    ],
)
def test_values_are_completed(words, incomplete, expected):
    completion = ShellComplete(pcsr, {}, "pcsr", "_PCSR_COMPLETE")
    assert sorted(item.value for item in completion.get_completions(words, incomplete)) == expected
