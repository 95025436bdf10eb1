"""Packages that come with an extra of pcsr, imported where they are used: `pip install pcsr` brings none of them."""

import importlib
import platform
from collections.abc import Iterable, Mapping
from importlib.util import find_spec
from typing import Any, NamedTuple

from pcsr.errors import UserError


class Package(NamedTuple):
    """An optional package: the name that pip knows it by, and the extra that installs it."""

    title: str
    extra: str
    machines_without: frozenset[str] = frozenset()
    """Processors for which there is no wheel on Linux, as `platform.machine` calls them."""


PACKAGES = {
    "lightning_fabric": Package("lightning-fabric", "train"),
    "ot": Package("pot", "train"),
    "embreex": Package("embreex", "simulate", frozenset({"aarch64"})),
    "manifold3d": Package("manifold3d", "simulate"),
    "plotly": Package("plotly", "report"),
    "matplotlib": Package("matplotlib", "report"),
    "pypcd4": Package("pypcd4", "pcd"),
    "laspy": Package("laspy", "las"),
    "lazrs": Package("lazrs", "las"),
    "distributed": Package("distributed", "cluster"),
    "huggingface_hub": Package("huggingface-hub", "hub"),
    "onnx": Package("onnx", "onnx"),
    "onnxscript": Package("onnxscript", "onnx"),
    "open3d": Package("open3d", "open3d"),
}
"""Every optional package by the name that Python imports it by; pyproject.toml says the same of the extras."""


def imported(module: str, user: str) -> Any:
    """The optional package, or a module of it.

    Args:
        module: what to import, such as "embreex.rtcore_scene".
        user: what needs it, as the subject of a sentence in the singular: "touch 'digit'".

    Raises:
        UserError: it is not installed, or cannot be loaded; the message names the extra.
    """
    package = module.partition(".")[0]
    require({package: user})
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise UserError(
            f"{user} needs {_title(package)}, which is installed but cannot be loaded ({error}): {remedy([package])}"
        ) from error


def require(needs: Mapping[str, str]) -> None:
    """Check that optional packages are installed, without importing them: before the work that needs them.

    Args:
        needs: the package that is imported, and what needs it, as the subject of a sentence in the singular.

    Raises:
        UserError: some are not installed; one message names them all, and the extras.
    """
    missing = {package: user for package, user in needs.items() if not installed(package)}
    if missing:
        users = {user: [_title(package) for package, of in missing.items() if of == user] for user in missing.values()}
        said = ", ".join(f"{user} needs {' and '.join(titles)}" for user, titles in users.items())
        which = "which is not" if len(missing) == 1 else "none of which is"
        raise UserError(f"{said}, {which} installed: {remedy(missing)}")


def installed(package: str) -> bool:
    """Whether a package can be found."""
    try:
        return find_spec(package) is not None
    except (ImportError, ValueError):
        return False


def remedy(packages: Iterable[str]) -> str:
    """The command that installs packages, and what to do about those that this machine has no wheel of."""
    here = platform.machine() if platform.system() == "Linux" else ""
    packages = list(packages)
    nowhere = [package for package in packages if package in PACKAGES and here in PACKAGES[package].machines_without]
    extras = sorted({PACKAGES[package].extra for package in packages if package in PACKAGES and package not in nowhere})
    others = [package for package in packages if package not in PACKAGES]
    wanted = [*([f"'pcsr[{','.join(extras)}]'"] if extras else []), *others]
    steps = [f"pip install {' '.join(wanted)}"] if wanted else []
    steps += [f"{package} has no wheel for Linux on {here}, so do this on another machine" for package in nowhere]
    return "; ".join(steps)


def _title(package: str) -> str:
    return PACKAGES[package].title if package in PACKAGES else package
