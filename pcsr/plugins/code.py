"""The code of parts as a hash: the files of a plugin as they are now."""

import hashlib
import importlib.util
from collections.abc import Iterable, Iterator
from importlib.metadata import PackageNotFoundError, distribution
from modulefinder import ModuleFinder
from pathlib import Path
from typing import Any

LENGTH = 12
"""Hexadecimal digits of a hash."""
OURS = ("pcsr", "pcsr_plugins")
"""What a plugin imports of us is no code of its own."""
GROUP = "pcsr"
"""The entry-point group that plugins announce themselves in."""


def file_code(file: Path) -> str | None:
    """The hash of a plugin file and of the modules beside it that it imports.

    Args:
        file: of Python.

    Returns:
        12 hexadecimal digits; None if the file is not there.
    """
    if not file.is_file():
        return None
    file = file.resolve()
    # Under another name the file itself is the same code.
    names = {path: "" if path == file else path.relative_to(file.parent).as_posix() for path in _local_modules(file)}
    return _hash((name, path) for path, name in names.items())


def distribution_code(name: str) -> str | None:
    """The hash of the version of an installed distribution and of the files of its packages.

    The files are read where Python imports them from, so an editable installation changes its hash with each edit, and
    gives the hash of a wheel of the same files.

    Args:
        name: of the distribution.

    Returns:
        12 hexadecimal digits; None if it is not installed.
    """
    try:
        found = distribution(name)
    except PackageNotFoundError:
        return None
    files = [pair for package in sorted(_packages(found)) for pair in _files(package)]
    return _hash(files, f"{name} {found.version}")


def python_files(owner: str, *, in_file: bool) -> list[Path]:
    """The Python files of a plugin: of a plugin file with the modules beside it, or of an installed distribution."""
    if in_file:
        return _local_modules(Path(owner).resolve()) if Path(owner).is_file() else []
    try:
        found = distribution(owner)
    except PackageNotFoundError:
        return []
    return [path for package in sorted(_packages(found)) for _, path in _files(package) if path.suffix == ".py"]


def _hash(files: Iterable[tuple[str, Path]], head: str = "") -> str:
    digest = hashlib.sha256(head.encode())
    for name, path in sorted(files):
        digest.update(f"\n{name} {hashlib.sha256(path.read_bytes()).hexdigest()}".encode())
    return digest.hexdigest()[:LENGTH]


def _local_modules(file: Path) -> list[Path]:
    """The file, and what it imports from its folder, directly or not."""
    finder = ModuleFinder(path=[str(file.parent)], excludes=list(OURS))
    try:
        finder.run_script(str(file))
    except Exception:  # a module beside it that is no Python, which it may import on a condition
        return [file]
    # A package without an `__init__` has no file.
    found = {Path(named) for module in finder.modules.values() if (named := getattr(module, "__file__", None))}
    return [path for path in {one.resolve() for one in found} | {file} if path.is_relative_to(file.parent)]


def _packages(found: Any) -> set[str]:
    """The modules and packages of a distribution, by the names that they are imported by."""
    # Not `Distribution`: where the backport importlib_metadata was imported, it gives those of its own class.
    announced = {point.module.partition(".")[0] for point in found.entry_points if point.group == GROUP}
    return announced | set((found.read_text("top_level.txt") or "").split())


def _files(package: str) -> Iterator[tuple[str, Path]]:
    """Each file of a package, compiled and hidden ones left out, and its name in it."""
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        return
    if spec.submodule_search_locations is None:
        if spec.origin is not None and Path(spec.origin).is_file():
            yield package, Path(spec.origin)
        return
    for folder in map(Path, spec.submodule_search_locations):
        for path in folder.rglob("*"):
            inner = path.relative_to(folder)
            if path.is_file() and not any(one == "__pycache__" or one.startswith(".") for one in inner.parts):
                yield f"{package}/{inner.as_posix()}", path
