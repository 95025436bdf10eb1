"""The process itself: closed and full streams, encodings, terminals, folders that are gone, Ctrl-C at any moment."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

PCSR = f"{sys.executable} -m pcsr.cli"

UNIX = Path("/dev/full").exists() and shutil.which("sh") is not None
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not UNIX, reason="the shell and /dev/full of a Unix are needed"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("shell")
    np.savetxt(made / "in.xyz", np.random.default_rng(0).normal(size=(60, 3)))
    return made


@pytest.fixture
def sh(folder):
    def run(command, **environment):
        before = sorted(folder.iterdir())
        done = subprocess.run(
            ["sh", "-c", command.replace("pcsr", PCSR, 1)],
            cwd=folder,
            env={**os.environ, "OMP_NUM_THREADS": "1", **environment},
            capture_output=True,
            timeout=60,
        )
        assert sorted(folder.iterdir()) == before
        assert b"Traceback" not in done.stderr
        assert b"Exception ignored" not in done.stderr
        return done.returncode, done.stdout, done.stderr.decode().strip().splitlines()

    return run


FULL = "pcsr: error: the disk is full: free some space and run again"


@pytest.mark.parametrize("command", ["--help", "--version", "recipe check --help", "plugins --why iterative"])
def test_output_onto_a_full_disk(sh, command):
    assert sh(f"pcsr {command} > /dev/full") == (1, b"", [FULL])


def test_a_cloud_onto_a_full_disk(sh):
    code, _, said = sh("pcsr upsample in.xyz -o - --model midpoint --quiet > /dev/full")
    assert code == 1
    assert said == [FULL]


def test_messages_onto_a_full_disk_change_no_exit_code(sh):
    assert sh("pcsr upsample missing.xyz -o out.ply 2> /dev/full") == (2, b"", [])
    assert sh("pcsr --help > /dev/full 2> /dev/full") == (1, b"", [])


def test_a_closed_input_is_refused(sh):
    code, _, said = sh("pcsr upsample - -o out.ply --model midpoint <&-")
    assert code == 2
    assert said == [
        "pcsr: error: -: standard input is closed: name a file, or let another command write to the pipe",
    ]


def test_a_cloud_for_a_closed_output_is_refused_before_the_work(sh):
    code, _, said = sh("pcsr upsample in.xyz -o - --model midpoint >&-")
    assert code == 2
    assert said == [
        "pcsr: error: -o -: standard output is closed: name a file, or let another command read from the pipe"
    ]


def test_a_command_that_nobody_hears_does_its_work(folder):
    out = folder / "cloud.xyz"
    command = f"{PCSR} upsample in.xyz -o {out} --model midpoint <&- >&- 2>&-"
    assert subprocess.run(["sh", "-c", command], cwd=folder, timeout=60).returncode == 0
    assert len(np.loadtxt(out)) == 240  # and nothing that was printed went into it
    out.unlink()
    assert subprocess.run(["sh", "-c", f"{PCSR} --help >&-"], cwd=folder, timeout=60).returncode == 0


def test_a_reader_that_leaves_is_no_error(sh):
    code, out, said = sh("pcsr plugins --why iterative | head -c 1")
    assert (code, out, said) == (0, b"f", [])


@pytest.mark.parametrize("environment", [{"PYTHONIOENCODING": "ascii"}, {"LC_ALL": "C", "PYTHONUTF8": "0"}])
def test_an_encoding_without_our_letters(sh, environment):
    code, out, said = sh("pcsr plugins --why é×⁻³", **environment)
    assert (code, out) == (2, b"")
    assert "no installed plugin registers a part" in said[-1]
    code, _, said = sh("pcsr é×⁻³", **environment)
    assert code == 2
    assert "no such command" in said[-1]


@pytest.mark.parametrize("columns", ["0", "1", "x", "-5", "1" + 30 * "0"])
def test_a_terminal_of_no_width(sh, columns):
    code, out, said = sh("pcsr --help", COLUMNS=columns)
    assert (code, said) == (0, [])
    assert b"Make a cloud dense and write it." in out


def test_a_table_on_a_terminal_of_no_width(sh):
    code, out, said = sh("pcsr plugins", COLUMNS="0")
    assert (code, said) == (0, [])
    assert b"pu-transformer" in out


def test_no_home(folder):
    environment = {name: value for name, value in os.environ.items() if name != "HOME"}
    command = [*PCSR.split(), "upsample", "in.xyz", "-o", "-", "--model", "midpoint", "--quiet"]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, b"")


def test_a_current_folder_that_is_gone(sh):
    code, _, said = sh("mkdir gone; cd gone; rmdir ../gone; exec pcsr plugins --why nobody")
    assert code == 2
    assert said == ["pcsr: error: the current folder cannot be used (No such file or directory): change to another one"]
    assert sh("mkdir gone; cd gone; rmdir ../gone; exec pcsr --help")[0] == 0


@pytest.mark.parametrize("seconds", [0.2, 0.8, 2.0])
def test_ctrl_c_at_any_moment_is_one_line(folder, seconds):
    """In a pipe, so that the command waits for its input where it comes so far."""
    python, *command = [*PCSR.split(), "upsample", "-", "-o", "out.ply"]
    command = [python, "-X", "importtime", *command]  # which shows whether pcsr had begun
    process = subprocess.Popen(command, cwd=folder, stdin=subprocess.PIPE, stderr=subprocess.PIPE)
    time.sleep(seconds)
    process.send_signal(signal.SIGINT)
    lines = process.communicate(timeout=30)[1].decode().strip().splitlines()
    imports = [line for line in lines if line.startswith("import time:")]
    if process.returncode == -signal.SIGINT and not any("pcsr" in line for line in imports):
        pytest.skip("the machine is so busy that Python had not begun with pcsr")
    assert process.returncode == 130
    said = [line for line in lines if line not in imports]
    assert said == ["interrupted; what is finished is kept, and no file is half written"]
    assert not (folder / "out.ply").exists()


def test_ctrl_c_while_the_command_line_is_imported(folder, tmp_path):
    (tmp_path / "click.py").write_text("raise KeyboardInterrupt")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run([*PCSR.split(), "--help"], cwd=folder, env=environment, capture_output=True, timeout=60)
    assert done.returncode == 130
    assert done.stderr.decode() == "interrupted; what is finished is kept, and no file is half written\n"


def test_warnings_of_libraries_stay_behind_and_those_of_pcsr_are_a_line(tmp_path):
    command = """
import warnings
import click
from pcsr.cli import main, pcsr
from pcsr.errors import PcsrWarning

@click.command()
def warn():
    import numpy as np
    np.array([1.0]) / np.array([0.0])
    warnings.warn("of torch", UserWarning)
    warnings.warn("of pcsr", PcsrWarning)

pcsr.add_command(warn, "warn")
type(pcsr).get_command = lambda self, ctx, name: warn
type(pcsr).resolve_command = lambda self, ctx, args: ("warn", warn, args[1:])
main({arguments})
"""
    for arguments, expected in ((["warn"], ["pcsr: warning: of pcsr"]), (["--traceback", "warn"], None)):
        done = subprocess.run(
            [sys.executable, "-c", command.replace("{arguments}", repr(arguments))], capture_output=True, timeout=60
        )
        said = done.stderr.decode().splitlines()
        assert done.returncode == 0, said
        if expected is not None:
            assert said == expected
        else:
            assert "RuntimeWarning: divide by zero" in "\n".join(said)
