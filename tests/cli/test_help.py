"""The command line itself: help without heavy imports, commands of plugins, errors as one line and a code."""

import errno
import re
import subprocess
import sys

import click
import pytest
from click.testing import CliRunner

from pcsr import cli
from pcsr.errors import RunError, UserError

HEAVY = ("torch", "numpy", "scipy", "trimesh", "plotly", "pydantic")


@pytest.fixture
def invoke():
    return lambda *arguments: CliRunner().invoke(cli.pcsr, arguments)


@pytest.fixture
def command(monkeypatch):
    """Put a function in as the command `probe`."""

    def install(function):
        probe = click.command(name="probe")(function)
        monkeypatch.setitem(cli.COMMANDS, "probe", cli.BuiltIn(f"{__name__}:probe", "Probe."))
        monkeypatch.setattr(sys.modules[__name__], "probe", probe, raising=False)
        return probe

    return install


def test_no_help_page_loads_what_is_heavy():
    pages = [["--help"], ["--version"], ["plugins", "--help"], ["recipe", "--help"]]
    pages += [["recipe", sub, "--help"] for sub in ("check", "show", "schema")]
    script = f"""
import sys
from click.testing import CliRunner
from pcsr.cli import pcsr
for page in {pages}:
    result = CliRunner().invoke(pcsr, page)
    assert result.exit_code == 0, (page, result.output, result.exception)
    loaded = [name for name in {HEAVY} if name in sys.modules]
    assert not loaded, (page, loaded)
"""
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_each_command_has_a_help_page_that_loads_no_torch(name):
    script = (
        "import sys; from click.testing import CliRunner; from pcsr.cli import pcsr;"
        f"result = CliRunner().invoke(pcsr, [{name!r}, '--help']);"
        "print(result.output); sys.exit(result.exit_code or 3 * ('torch' in sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    # The line in `pcsr --help` and the first of the page are the same.
    assert cli.COMMANDS[name].summary in done.stdout


def pages(command, path, above=None):
    """The help page of each command, with its path."""
    context = click.Context(command, above, info_name=path[-1])
    yield path, command.get_help(context)
    if isinstance(command, click.Group):
        for name in cli.COMMANDS if above is None else command.list_commands(context):
            yield from pages(command.get_command(context, name), (*path, name), context)


def test_no_help_page_has_markup():
    found = dict(pages(cli.pcsr, ("pcsr",)))
    assert len(found) > len(cli.COMMANDS)
    for path, page in found.items():
        assert not re.search(r"`|\*\*|:\w+:|\[/?(bold|red)\]|\x08", page), path


def test_help_lists_each_command_in_a_line(invoke):
    shown = invoke("--help").output
    for name, built_in in cli.COMMANDS.items():
        assert any(line.split()[:1] == [name] and built_in.summary in line for line in shown.splitlines())


def test_a_misspelt_command_gets_a_suggestion(invoke):
    result = invoke("plugin")
    assert result.exit_code == 2
    assert "no such command 'plugin': did you mean 'plugins'?" in result.output


def install(folder, name, entry_points):
    """What an installer leaves of a distribution."""
    info = folder / f"{name}-2.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 2.0\n")
    (info / "entry_points.txt").write_text(f"[pcsr.commands]\n{entry_points}")


def test_commands_of_plugins_are_listed_unloaded_and_loaded_when_called(invoke, tmp_path, monkeypatch):
    install(tmp_path, "lab", "greet = pcsr_test_lab:greet\nbroken = pcsr_test_no_such:x\nodd = math:pi\nrun = a:b")
    install(tmp_path, "other", "twice = a:b")
    install(tmp_path, "third", "twice = c:d")
    (tmp_path / "pcsr_test_lab.py").write_text(
        "import click\n@click.command()\ndef greet():\n    click.echo('hello from the lab')\n"
    )
    monkeypatch.syspath_prepend(tmp_path)

    shown = invoke("--help")
    assert shown.exit_code == 0
    assert "pcsr_test_lab" not in sys.modules
    assert ["greet", "From", "lab."] in [line.split() for line in shown.output.splitlines()]
    assert invoke("greet").output == "hello from the lab\n"
    assert cli.pcsr.list_commands(click.Context(cli.pcsr)).count("run") == 1

    for name, said in [
        (
            "broken",
            "command 'broken' of lab cannot be loaded from 'pcsr_test_no_such:x': ModuleNotFoundError",
        ),
        ("odd", "command 'odd' of lab is 3.14"),
        ("twice", "command 'twice' is announced twice, by other and by third: uninstall one of them"),
    ]:
        result = invoke(name)
        assert (result.exit_code, said in result.stderr) == (2, True), result.stderr


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (UserError("no such thing"), 2, "pcsr: error: no such thing\n"),
        (RunError("the loss is not finite"), 1, "pcsr: error: the loss is not finite\n"),
        (KeyboardInterrupt(), 130, "interrupted; what is finished is kept, and no file is half written\n"),
        (
            OSError(errno.ENOSPC, "No space left on device", "x.bin"),
            1,
            "pcsr: error: the disk is full (writing x.bin): free some space and run again\n",
        ),
        (
            ValueError("no"),
            1,
            "pcsr: error: ValueError: no (run again with --traceback: pcsr --traceback …)\n",
        ),
        (
            SystemExit(7),
            1,
            "pcsr: error: SystemExit: 7 (run again with --traceback: pcsr --traceback …)\n",
        ),
        (
            AssertionError(),
            1,
            "pcsr: error: AssertionError (run again with --traceback: pcsr --traceback …)\n",
        ),
    ],
)
def test_an_error_is_one_line_and_a_code(invoke, command, error, code, said):
    @command
    def probe():
        raise error

    result = invoke("probe")
    assert (result.exit_code, result.stderr, result.stdout) == (code, said, "")
    traced = invoke("--traceback", "probe")
    assert traced.exit_code == code
    assert traced.stderr.startswith("Traceback (most recent call last):")
    assert traced.stderr.endswith(said)


def test_a_command_that_succeeds_exits_with_zero(invoke, command):
    @command
    def probe():
        click.echo("done")

    result = invoke("probe")
    assert (result.exit_code, result.output) == (0, "done\n")


def test_main_exits(monkeypatch, capsys):
    monkeypatch.setenv("PYTHONWARNINGS", "ignore")  # main sets it, and processes of later tests would inherit it
    with pytest.raises(SystemExit) as caught:
        cli.main(["--version"])
    assert caught.value.code == 0
    assert capsys.readouterr().out.startswith("pcsr, version ")
