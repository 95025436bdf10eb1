"""Hashes of the code of plugins, which show whether a part has changed since weights were trained."""

import hashlib
import importlib.util
import os
from collections.abc import Iterable, Iterator
from importlib.machinery import PathFinder
from importlib.metadata import PackageNotFoundError, distribution
from modulefinder import Module, ModuleFinder
from pathlib import Path
from typing import Any

LENGTH = 12
"""Length of a hash in hexadecimal digits."""
EXCLUDED = ("pcsr", "pcsr_plugins")
"""Packages that plugins import but that are not part of their code."""
GROUP = "pcsr"
"""Entry-point group of plugins."""
ABOVE = 3
"""Number of folders above a file in which the modules that it imports are searched."""
PACKAGE = 5
"""Kind of a package in `modulefinder`."""
LARGEST = 1 << 24
"""Greatest size of a plugin file in bytes; a larger one is not read."""


def file_code(file: Path, others: Iterable[Path] = ()) -> str | None:
    """Hash a plugin file and the modules of its folder that it imports.

    Args:
        file: Python file.
        others: further files of its code.

    Returns:
        12 hexadecimal digits, or None if there is no such file.
    """
    if not file.is_file():
        return None
    file = file.resolve()
    # The name of the file itself does not count: a renamed file has the same code.
    names = {
        path: "" if path == file else Path(os.path.relpath(path, file.parent)).as_posix()
        for path in {*_local_modules(file), *others}
    }
    return _hash((name, path) for path, name in names.items())


def distribution_code(name: str) -> str | None:
    """Hash the version of an installed distribution and the files of its packages.

    The files are read from where Python imports them. The hash of an editable installation therefore changes with each
    edit, and equals that of a wheel of the same files.

    Args:
        name: name of the distribution.

    Returns:
        12 hexadecimal digits, or None if it is not installed.
    """
    try:
        found = distribution(name)
    except PackageNotFoundError:
        return None
    files = [pair for package in sorted(_packages(found)) for pair in _files(package)]
    return _hash(files, f"{name} {found.version}")


def own_code() -> str:
    """Hash the Python files of pcsr and of the parts that come with it.

    Examples:
        >>> own_code() == own_code()
        True
    """
    files = (pair for package in EXCLUDED for pair in _files(package))
    return _hash((name, path) for name, path in files if path.suffix == ".py")


def python_files(owner: str, *, in_file: bool) -> list[Path]:
    """List the Python files of a plugin.

    Args:
        owner: path of a plugin file, or name of an installed distribution.
        in_file: `owner` is a plugin file; the modules of its folder that it imports are listed too.
    """
    if in_file:
        file = Path(owner).resolve()
        return _local_modules(file) if file.is_file() and file.stat().st_size <= LARGEST else []
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


def folder_of(module: str, file: Path) -> Path | None:
    """Return the folder from which a file imports a module: its own, or one above it; None if none has the module."""
    first = module.partition(".")[0]
    for folder in file.resolve().parents[: 1 + ABOVE]:
        if (folder / f"{first}.py").is_file() or (folder / first).is_dir():
            return folder
    return None


def _local_modules(file: Path) -> list[Path]:
    """List the file and the modules of its folder that it imports, directly or indirectly."""
    finder = _Finder(path=[str(file.parent)], excludes=list(EXCLUDED))
    try:
        finder.run_script(str(file))
    except Exception:  # a module that cannot be parsed, which the file may import conditionally
        return [file]
    # A package without an `__init__.py` has no file.
    found = {Path(named) for module in finder.modules.values() if (named := getattr(module, "__file__", None))}
    return [path for path in {one.resolve() for one in found} | {file} if path.is_relative_to(file.parent)]


class _Finder(ModuleFinder):
    """Finder that follows packages without an `__init__.py` too, as many repositories have them."""

    def find_module(self, name: str, path: Any, parent: Module | None = None) -> Any:
        """Return file, path and kind of a module; the path of a package is its folder."""
        PathFinder.invalidate_caches()
        spec = None if name in self.excludes else PathFinder.find_spec(name, path or self.path)
        if spec is not None and spec.origin is None and spec.submodule_search_locations:
            return None, next(iter(spec.submodule_search_locations)), ("", "", PACKAGE)
        return super().find_module(name, path, parent)

    def load_package(self, fqname: str, pathname: str) -> Module:
        """Return a package; that without an `__init__.py` has no file."""
        if (Path(pathname) / "__init__.py").is_file():
            return super().load_package(fqname, pathname)
        package = self.modules[fqname] = Module(fqname, None, [pathname])  # type: ignore[arg-type]  # typeshed says str
        return package


def _packages(found: Any) -> set[str]:
    """List the top-level modules and packages of a distribution by their import names."""
    # `found` is untyped: after an import of the backport importlib_metadata it is an instance of that one's class.
    announced = {point.module.partition(".")[0] for point in found.entry_points if point.group == GROUP}
    return announced | set((found.read_text("top_level.txt") or "").split())


def _files(package: str) -> Iterator[tuple[str, Path]]:
    """Yield the name within the package and the path of each file of a package, except compiled and hidden ones."""
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
