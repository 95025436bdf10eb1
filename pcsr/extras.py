"""Optional packages, which the extras of pcsr install; they are imported where they are used."""

import importlib
import platform
import re
from collections.abc import Iterable, Mapping
from importlib.util import find_spec
from typing import Any, NamedTuple

from pcsr.errors import UserError


class Package(NamedTuple):
    """Name of an optional package for pip, and the extra that installs it."""

    title: str
    extra: str
    machines_without: frozenset[str] = frozenset()
    """Processors without a wheel for Linux, by the names of `platform.machine`."""
    system: tuple[str, ...] = ()
    """Libraries of the system that it needs on Linux, by the names of Debian's packages."""


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
    "pye57": Package("pye57", "e57", frozenset({"aarch64"})),
    "rosbags": Package("rosbags", "ros"),
    "distributed": Package("distributed", "cluster"),
    "huggingface_hub": Package("huggingface-hub", "hub"),
    "onnx": Package("onnx", "onnx"),
    "onnxscript": Package("onnxscript", "onnx"),
    "open3d": Package("open3d", "open3d", system=("libusb-1.0-0", "libgl1", "libgomp1")),
}
"""Optional packages by the name of their module. pyproject.toml lists the same packages for each extra."""

LIBRARY = re.compile(r"\blib[\w.+-]+\.(?:so[\w.]*|dylib)")
"""Name of a shared library in an error of the system's loader."""
GLIBC = re.compile(r"`GLIBC_([\d.]+)' not found")
"""Version of glibc that the loader does not find."""


def imported(module: str, user: str) -> Any:
    """Import an optional package or one of its modules.

    Args:
        module: name of the module, such as "embreex.rtcore_scene".
        user: feature that needs the package, as the singular subject of the error message: "touch 'digit'".

    Returns:
        The module.

    Raises:
        UserError: the package is not installed or cannot be loaded; the message names the extra.
    """
    package = module.partition(".")[0]
    require({package: user})
    try:
        return importlib.import_module(module)
    except (ImportError, OSError) as error:
        raise UserError(
            f"{user} needs {_title(package)}, which is installed but cannot be loaded: {_load_fault(package, error)}"
        ) from error


def require(needs: Mapping[str, str]) -> None:
    """Check that optional packages are installed, without importing them.

    Args:
        needs: for each package, by the name of its module, the feature that needs it, as in `imported`.

    Raises:
        UserError: some are not installed; the message names all of them and the extras that install them.
    """
    missing = {package: user for package, user in needs.items() if not installed(package)}
    if missing:
        users = {user: [_title(package) for package, of in missing.items() if of == user] for user in missing.values()}
        reasons = ", ".join(f"{user} needs {' and '.join(titles)}" for user, titles in users.items())
        which = "which is not" if len(missing) == 1 else "none of which is"
        raise UserError(f"{reasons}, {which} installed: {remedy(missing)}")


def installed(package: str) -> bool:
    """Return whether a package is installed."""
    try:
        return find_spec(package) is not None
    except (ImportError, ValueError):
        return False


def _load_fault(package: str, error: Exception) -> str:
    """Return why an installed package cannot be loaded, and the remedy."""
    library = LIBRARY.search(str(error))
    if glibc := GLIBC.search(str(error)):
        return f"it needs glibc {glibc[1]} or newer, a newer version of Linux than this one"
    if library:
        system = PACKAGES[package].system if package in PACKAGES else ()
        how = f"on Debian and Ubuntu, apt-get install {' '.join(system)}" if system else "install it"
        return f"the library {library[0]} of the system is missing: {how}"
    if isinstance(error, ModuleNotFoundError) and error.name:
        return f"it needs {error.name}, which is not installed: {remedy([package])}"
    return f"it is damaged, or made for another version of Python: {remedy([package])}"


def remedy(packages: Iterable[str]) -> str:
    """Return the command that installs packages, and a note on those that have no wheel for this machine."""
    processor = platform.machine() if platform.system() == "Linux" else ""
    packages = list(packages)
    no_wheel = [name for name in packages if name in PACKAGES and processor in PACKAGES[name].machines_without]
    extras = sorted({PACKAGES[name].extra for name in packages if name in PACKAGES and name not in no_wheel})
    others = [name for name in packages if name not in PACKAGES]
    wanted = [*([f"'pcsr[{','.join(extras)}]'"] if extras else []), *others]
    steps = [f"pip install {' '.join(wanted)}"] if wanted else []
    steps += [f"{name} has no wheel for Linux on {processor}, so do this on another machine" for name in no_wheel]
    return "; ".join(steps)


def _title(package: str) -> str:
    return PACKAGES[package].title if package in PACKAGES else package
