"""Plugin files that are broken, or spoil the process around them: it is set back, and who did it is named."""

import os
import re
import subprocess
import sys
import warnings

import numpy as np
import pytest
import torch

from pcsr.errors import PcsrWarning
from pcsr.plugins.loading import load_plugins

GOOD = """
from pcsr import Encoder, Fusion, hookimpl

{top}

class Mine(Fusion):
    def __init__(self, widths, *, deep: int = 1):
        super().__init__()
        {body}

@hookimpl
def pcsr_register(register):
    {register}
"""


@pytest.fixture
def write(tmp_path):
    def write_plugin(top="", body="pass", register="register.fusion('mine', Mine)", name="lab.py"):
        path = tmp_path / name
        path.write_text(GOOD.format(top=top, body=body, register=register))
        return path

    return write_plugin


def state():
    return (
        torch.get_default_dtype(),
        torch.get_default_device(),
        torch.get_num_threads(),
        torch.is_grad_enabled(),
        torch.are_deterministic_algorithms_enabled(),
        torch.get_float32_matmul_precision(),
        np.geterr(),
        np.get_printoptions(),
        os.getcwd(),
        os.environ.get("OMP_NUM_THREADS"),
        list(sys.path),
        sys.stdin,
        sys.stdout,
        sys.stderr,
        list(warnings.filters),
    )


SPOILT = {
    "torch's default dtype": "import torch; torch.set_default_dtype(torch.float64)",
    "torch's default device": "import torch; torch.set_default_device('meta')",
    "torch's number of threads": "import torch; torch.set_num_threads(torch.get_num_threads() + 3)",
    "whether torch computes gradients": "import torch; torch.set_grad_enabled(False)",
    "whether torch uses deterministic algorithms": "import torch; torch.use_deterministic_algorithms(True)",
    "torch's precision of matrix products": "import torch; torch.set_float32_matmul_precision('medium')",
    "numpy's error handling": "import numpy; numpy.seterr(all='raise')",
    "numpy's print options": "import numpy; numpy.set_printoptions(precision=1)",
    "the working directory": "import os; os.chdir('/')",
    "the environment variables of threads": "import os; os.environ['OMP_NUM_THREADS'] = '99'",
    "signal handlers": "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)",
    "warning filters": "import warnings; warnings.simplefilter('ignore')",
    "sys.path": "import sys; sys.path.clear()",
    "sys.stdin": "import sys; sys.stdin = None",
    "sys.stdout": "import sys; sys.stdout.close()",
    "sys.stderr": "import io, sys; sys.stderr = io.StringIO()",
}


@pytest.mark.parametrize("what", SPOILT)
def test_what_a_plugin_changes_is_set_back_and_said(write, what):
    before = state()
    with pytest.warns(PcsrWarning, match=f"plugin .*lab.py changed {what}") as said:
        registry = load_plugins([write(SPOILT[what])])
    assert state() == before
    assert len(said) == 1
    assert registry.names("fusion").count("mine") == 1  # it is of use nevertheless


def test_a_plugin_that_changes_nothing_is_not_mentioned(write):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_plugins([write("import sys, torch; sys.path.append('/somewhere'); torch.manual_seed(1)")])
    sys.path.remove("/somewhere")


def test_a_plugin_that_fails_leaves_nothing_changed_either(write):
    before = state()
    with pytest.warns(PcsrWarning, match="torch's default dtype"):
        registry = load_plugins([write("import torch; torch.set_default_dtype(torch.float64); raise ValueError")])
    assert state() == before
    assert registry.failures


def test_a_constructor_that_changes_something(write):
    from pcsr.contracts import Widths
    from pcsr.recipe.section import PartSpec

    registry = load_plugins([write(body="import torch; torch.set_default_dtype(torch.float64)")])
    before = state()
    with pytest.warns(
        PcsrWarning, match="the constructor of fusion 'mine' changed torch's default dtype to torch.float64"
    ):
        PartSpec(use="mine").build(registry, "fusion", Widths())
    assert state() == before


@pytest.mark.parametrize(
    ("register", "said"),
    [
        ("register.fusion(3, Mine)", r"3 is no valid name for a part \(fusion of"),
        ("register.fusion('', Mine)", "'' is no valid name"),
        ("register.fusion('my fusion', Mine)", "'my fusion' is no valid name"),
        ("register.fusion('a\\nb', Mine)", "is no valid name"),
        ("register.fusion('a' * 300, Mine)", r"is no valid name for a part \(fusion"),
        ("register.fusion('mine', 3)", "fusion 'mine' of .* is 3: register its class"),
        ("register.fusion('mine', lambda: 3)", "fusion 'mine' of .* register its class"),
        ("register.fusion('mine', Mine(None))", "fusion 'mine' of .* register its class"),
        ("register.fusion(['mine'], Mine)", "is no valid name"),
    ],
)
def test_a_part_or_a_name_that_is_none(limited, write, tmp_path, register, said):
    write(register=register)
    outcome = limited("plugins", "--why", "lab.py", "--plugin", "lab.py", folder=tmp_path)
    assert re.search(said, outcome.out), outcome.out
    assert outcome.out.startswith("lab.py file failed to load: UserError: ")
    assert len(outcome.out.splitlines()) == 1
    assert len(outcome.out) < 600


BROKEN = {
    "recursion": (b"def f(): f()\nf()", "RecursionError"),
    "syntax": (b"def f(:", "SyntaxError"),
    "nul": (b"a = 1\0", "null bytes"),
    "no hook": (b"a = 1", "registers nothing"),
    "exit": (b"import sys; sys.exit(0)", "SystemExit: 0"),
    "input": (b"input()", "EOFError"),
    "long": (b"raise ValueError('x' * 10**7)", "ValueError: xxx"),
    "wordless": (b"class E(Exception):\n def __str__(self): raise ValueError\nraise E", "E"),
    "latin": ("é = 1".encode("latin-1"), "SyntaxError"),
}


@pytest.mark.parametrize("how", BROKEN)
def test_a_broken_file_says_why_in_a_line(limited, tmp_path, how):
    content, said = BROKEN[how]
    (tmp_path / "lab.py").write_bytes(content)
    outcome = limited("plugins", "--why", "lab.py", "--plugin", "lab.py", folder=tmp_path)
    assert outcome.code == 0, outcome.err
    assert said in outcome.out
    assert len(outcome.out.splitlines()) <= 2
    assert len(outcome.out) < 1000
    assert outcome.err == ""


def test_what_is_no_file_of_python(limited, tmp_path):
    (tmp_path / "folder.py").mkdir()
    os.mkfifo(tmp_path / "pipe.py")
    with (tmp_path / "large.py").open("wb") as file:
        file.truncate(1 << 30)
    for name, said in (("folder.py", "that is a folder"), ("pipe.py", "no such file"), ("/dev/zero", "no such file")):
        limited("plugins", "--plugin", name, folder=tmp_path).refused(f"--plugin {name}: ", said)
    outcome = limited("plugins", "--why", "large.py", "--plugin", "large.py", folder=tmp_path)
    assert "large.py is larger than 16777216 bytes" in outcome.out
    assert outcome.megabytes < 50


def test_what_a_plugin_prints_is_no_part_of_the_output(limited, write, tmp_path):
    write("print('loading …')")
    outcome = limited("plugins", "--why", "mine", "--plugin", "lab.py", folder=tmp_path)
    assert outcome.out.startswith("fusion 'mine' comes from lab.py")
    assert "loading" in outcome.err


@pytest.mark.slow
def test_a_plugin_that_closes_the_streams_of_the_system(write, tmp_path):
    path = write("import os, sys; sys.__stdout__.close(); os.close(2); os.close(0)")
    done = subprocess.run(
        [sys.executable, "-m", "pcsr.cli", "plugins", "--why", "mine", "--plugin", path],
        capture_output=True,
        timeout=60,
        cwd=tmp_path,
    )
    assert done.returncode == 0
    assert done.stdout.startswith(b"fusion 'mine' comes from")
    said = done.stderr.decode().splitlines()
    assert [line.split(" changed ")[1].split(":")[0] for line in said] == ["sys.stdin", "sys.stdout", "sys.stderr"]


CHECKED = """
import os, time
import torch
from pcsr import Encoder, hookimpl

class Slow(Encoder):
    def __init__(self, widths, *, channels: int = 8):
        super().__init__()
        self.channels = channels
        self.layer = torch.nn.Linear(3, channels)

    def forward(self, points):
        if points.shape[1] == 101:  # the number of points in the check of shapes alone
            while True:
                time.sleep(0.1)
        if points.shape[0] == 1 and not os.path.exists("left"):  # at once, and in one check alone
            open("left", "w").close()
            os._exit(7)
        return self.layer(points)

class Spoiler(Slow):
    def forward(self, points):
        torch.set_default_dtype(torch.float64)
        return self.layer(points)

@hookimpl
def pcsr_register(register):
    register.encoder("slow", Slow)
    register.encoder("spoiler", Spoiler)
"""


@pytest.mark.slow
def test_a_check_that_runs_on_fails_and_the_others_go_on(tmp_path):
    (tmp_path / "lab.py").write_text(CHECKED)
    options = ["lab.py", "--plugin", "lab.py", "--time-limit", "15"]
    command = [sys.executable, "-m", "pcsr.cli", "plugins", "check", *options]
    done = subprocess.run(command, capture_output=True, timeout=400, cwd=tmp_path, text=True)
    assert done.returncode == 1, done.stderr
    slow, spoiler = done.stdout.split("encoder 'spoiler'")
    assert "FAILED  shapes: encoder 'slow': it did not end within 15 s" in slow
    assert "it ended its process with exit code 7" in slow
    assert "passed  gradients" in slow
    assert "2 failed" in slow
    assert "changed torch's default dtype to torch.float64" in spoiler
    assert done.stderr.strip() == (
        "pcsr: error: encoder 'slow', encoder 'spoiler' failed: the line of each failed check says how to mend it"
    )
