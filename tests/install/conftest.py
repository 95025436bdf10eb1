"""What pyproject.toml says of dependencies, and which installed packages are none of the core's."""

import tomllib
from importlib.metadata import PackageNotFoundError, packages_distributions, requires
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from pcsr.extras import PACKAGES

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def project():
    """The table `project` of pyproject.toml."""
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.fixture(scope="session")
def absent(project):
    """Top-level modules that are installed here, but would not be by `pip install pcsr`."""
    core = {"pcsr", "pip"} | needed(project["dependencies"])
    others = {
        module
        for module, owners in packages_distributions().items()
        if not core & {canonicalize_name(owner) for owner in owners}
    }
    return sorted(others | PACKAGES.keys())  # Python's table lacks modules that are a library alone, as manifold3d is


def needed(requirements):
    """The names of distributions that requirements lead to on this machine, theirs too."""
    found, waiting = set(), [Requirement(one) for one in requirements]
    while waiting:
        one = waiting.pop()
        name = canonicalize_name(one.name)
        if name in found or (one.marker and not any(one.marker.evaluate({"extra": e}) for e in ("", *one.extras))):
            continue
        found.add(name)
        try:
            waiting += [Requirement(line) for line in requires(name) or []]
        except PackageNotFoundError:  # torch names more than its wheel for the CPU needs
            continue
    return found
