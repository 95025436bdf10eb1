"""`pcsr plugins`: the table of parts, and what is wrong with those that can't be used."""

from importlib.metadata import version
from pathlib import Path

import pytest
from click.testing import CliRunner

from pcsr.cli import pcsr
from pcsr.plugins.registry import KINDS


def invoke(*arguments):
    return CliRunner(env={"COLUMNS": "200"}).invoke(pcsr, ["plugins", *map(str, arguments)])


@pytest.fixture
def plugin(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def write(name, body):
        Path(name).write_text(body)
        return name

    return write


def rows(output):
    """The cells of the table's rows."""
    return [[cell.strip() for cell in line.split("│")[1:-1]] for line in output.splitlines() if line.startswith("│")]


def test_it_lists_every_part_with_owner_version_and_traits():
    result = invoke()
    assert result.exit_code == 0
    table = rows(result.output)
    assert ["encoder", "mlp", "pcsr", version("pcsr"), "permutation-equivariant"] in table
    assert [kind for kind in KINDS if kind in {row[0] for row in table}] == list(KINDS)


def test_a_part_that_does_not_load_shows_its_error_in_its_row(plugin):
    name = plugin(
        "bad.py",
        "from pcsr import hookimpl\n@hookimpl\ndef pcsr_register(register):\n"
        "    register.fusion('lost', 'no_such:X')\n    register.fusion('red', 'pcsr:[bold]')\n",
    )
    result = invoke("--plugin", name)
    assert result.exit_code == 0
    text = " ".join(result.output.replace("│", " ").split())
    assert "fusion 'lost' of bad.py cannot be loaded from 'no_such:X': ModuleNotFoundError" in text
    assert "fusion 'red' of bad.py cannot be loaded from 'pcsr:[bold]': AttributeError" in text
    assert ["fusion", "lost", "bad.py", "file"] in [row[:4] for row in rows(result.output)]
    assert ["fusion", "iterative", "pcsr", version("pcsr")] in [row[:4] for row in rows(result.output)]


def test_a_plugin_that_failed_is_named_beneath_the_table(plugin):
    name = plugin("bad.py", "raise RuntimeError('no [bold] GPU')")
    result = invoke("--plugin", name)
    assert result.exit_code == 0
    assert result.output.splitlines()[-1] == (
        "bad.py file failed to load: RuntimeError: no [bold] GPU (pcsr plugins --why bad.py)"
    )
    why = invoke("--plugin", name, "--why", "bad.py").output.splitlines()
    assert why[0] == "bad.py file failed to load: RuntimeError: no [bold] GPU"
    assert why[1].endswith("bad.py:1")


def test_why_a_part_is_there():
    result = invoke("--why", "iterative")
    assert result.exit_code == 0
    assert result.output.startswith("fusion 'iterative' comes from pcsr ")


def test_why_of_an_unknown_name_is_a_mistake():
    result = invoke("--why", "iterativ")
    assert (result.exit_code, result.stdout) == (2, "")
    assert "called 'iterativ': did you mean 'iterative'?" in result.stderr


def test_commands_of_plugins_are_listed_and_those_that_ours_hide(tmp_path, monkeypatch):
    info = tmp_path / "lab-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[pcsr.commands]\ngreet = a:b\nrun = c:d\n")
    monkeypatch.syspath_prepend(tmp_path)
    lines = invoke().output.splitlines()
    assert "command greet comes from lab" in lines
    assert "command run comes from lab (not reachable: pcsr has a built-in command of this name)" in lines
