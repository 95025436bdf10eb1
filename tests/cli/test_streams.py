"""The console of all commands: a terminal's width on a terminal, no limit in a file or a pipe."""

import ast
import io
import re
import sys
from pathlib import Path

import pytest
from rich.table import Table

import pcsr.cli
from pcsr.cli import streams

LONG = "letter by letter " * 20


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def printed(monkeypatch):
    def on(stream, *, error=False):
        monkeypatch.setattr(sys, "stderr" if error else "stdout", stream)
        table = Table("name", "text")
        table.add_row("first", LONG)
        streams.console(error=error).print(table)
        return stream.getvalue()

    return on


@pytest.mark.parametrize("error", [False, True])
@pytest.mark.parametrize("environment", [{}, {"COLUMNS": "40"}, {"FORCE_COLOR": "1"}, {"TERM": "dumb"}])
def test_a_table_in_a_pipe_has_its_own_width(printed, monkeypatch, environment, error):
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    text = printed(io.StringIO(), error=error)
    assert f"│ first │ {LONG}" in text
    assert len(text.splitlines()) == 5
    assert "\x1b" not in text


def test_a_table_on_a_terminal_has_the_terminals_width(printed, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    lines = re.sub(r"\x1b\[\d*m", "", printed(Terminal())).splitlines()
    assert max(map(len, lines)) <= 40
    assert len(lines) > 5


@pytest.mark.parametrize("path", sorted(Path(pcsr.cli.__file__).parent.glob("*.py")), ids=lambda path: path.name)
def test_commands_use_no_other_console(path):
    made = [n for n in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(n, ast.Call)]
    names = {call.func.id for call in made if isinstance(call.func, ast.Name)}
    assert "Console" not in names or path.name == "streams.py"
