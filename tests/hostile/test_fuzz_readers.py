"""The fuzzer of all readers, for half a minute where everything is tested, else for some seconds."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

FUZZER = Path(__file__).with_name("fuzz_readers.py")
SECONDS = 30 if os.environ.get("CI") else 5
pytestmark = pytest.mark.slow


@pytest.mark.skipif(sys.platform == "win32", reason="memory is bounded by way of POSIX")
def test_damaged_files_are_refused_or_read(tmp_path):
    command = [sys.executable, FUZZER, "--minutes", str(SECONDS / 60), "--seed", "0", "--keep", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True, timeout=SECONDS + 200, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert int(done.stdout.split()[0]) > 20 * SECONDS / 5, done.stdout


def test_what_is_wrong_is_found(tmp_path):
    """A reader that lets an error through is a finding."""
    program = f"""
import sys
sys.argv = ["fuzz", "--index", "2", "--kinds", "meshes", "--folder", {str(tmp_path)!r}]
sys.path.insert(0, {str(FUZZER.parent)!r})
import pcsr.clouds.meshes as meshes
meshes.UserError = KeyError
import fuzz_readers
fuzz_readers.main()
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=200, check=False)
    assert done.returncode == 1
    assert "FOUND in" in done.stdout
    assert "KeyError" in done.stdout
