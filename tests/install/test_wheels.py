"""The core's requirements, and all that they require, as wheels for the machines that pcsr is for. Asks pip's index."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
ARM_TAGS = [f"manylinux_2_{minor}_aarch64" for minor in range(28, 16, -1)] + ["manylinux2014_aarch64"]
"""What pip takes where glibc is 2.28 or newer, as it has been since 2018."""
MACHINES = {
    # torch marks its CUDA libraries `platform_system == "Linux"`. Its wheel for the CPU has none, and to ask for each
    # takes a minute, so no system is named here.
    "Linux on aarch64": (ARM_TAGS, {"sys_platform": "linux", "platform_system": "", "platform_machine": "aarch64"}),
    "macOS on arm64": (
        ["macosx_14_0_arm64"],  # torch's oldest
        {"sys_platform": "darwin", "platform_system": "Darwin", "platform_machine": "arm64"},
    ),
    "Windows": (
        ["win_amd64"],
        {"sys_platform": "win32", "platform_system": "Windows", "platform_machine": "AMD64", "os_name": "nt"},
    ),
}
CASES = [("Linux on aarch64", "3.11"), ("Linux on aarch64", "3.14"), ("macOS on arm64", "3.14"), ("Windows", "3.11")]
"""Each takes a few seconds; those that are missing were looked at once."""
pytestmark = pytest.mark.slow


def pip_install(machine, python, *arguments):
    """The command that says what pip would install on a machine; it installs nothing."""
    tags, environment = MACHINES[machine]
    environment = environment | {"python_version": python, "python_full_version": f"{python}.0"}
    elsewhere = [Path(__file__).with_name("pip_elsewhere.py"), json.dumps(environment)]
    options = ["--dry-run", "--ignore-installed", "--only-binary", ":all:", "--quiet", "--retries", "1"]
    options += ["--python-version", python]
    options += [part for tag in tags for part in ("--platform", tag)]
    return [sys.executable, *elsewhere, "install", *options, *arguments]


@pytest.fixture(scope="module")
def resolved(project, tmp_path_factory):
    """What pip says in each case: its exit code, its report and its messages. All are asked at once."""
    folder = tmp_path_factory.mktemp("wheels")
    running = {}
    for number, (machine, python) in enumerate(CASES):
        options = ["--constraint", ROOT / "constraints.txt", "--target", folder]
        command = pip_install(
            machine, python, *options, "--report", folder / f"{number}.json", *project["dependencies"]
        )
        running[machine, python] = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    said = {case: process.communicate()[1] for case, process in running.items()}
    return {
        case: (process.returncode, folder / f"{number}.json", said[case])
        for number, (case, process) in enumerate(running.items())
    }


@pytest.mark.parametrize(("machine", "python"), CASES)
def test_the_core_has_a_wheel_of_everything(resolved, project, machine, python):
    code, report, said = resolved[machine, python]
    if code and "connection broken" in said:
        pytest.skip("pip cannot reach its index")
    assert code == 0, said
    found = json.loads(report.read_text(encoding="utf-8"))["install"]
    assert all(one["download_info"]["url"].endswith(".whl") for one in found)
    names = {canonicalize_name(one["metadata"]["name"]) for one in found}
    assert {"torch", "numpy", "scipy", "trimesh", "pydantic-core"} <= names
    assert not names & {"embreex", "manifold3d", "pot", "plotly"}
    assert python in SpecifierSet(project["requires-python"])


def test_a_package_without_a_wheel_is_noticed(tmp_path):
    """embreex has none for Linux on aarch64, which is why it is no requirement of the core."""
    command = pip_install("Linux on aarch64", "3.11", "--target", tmp_path, "embreex>=4.4")
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if "connection broken" in done.stderr:
        pytest.skip("pip cannot reach its index")
    assert done.returncode == 1
    assert "No matching distribution found for embreex" in done.stderr
