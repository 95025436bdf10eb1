"""Import of a Python file by its path, with the modules beside it and in the folders above that it imports."""

import hashlib
import importlib.util
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from pcsr.errors import UserError
from pcsr.plugins.code import LARGEST, folder_of

PREFIX = "pcsr_plugin_"
"""Beginning of the names of modules that are imported from files."""


def import_file(file: Path) -> tuple[ModuleType, list[Path]]:
    """Import a Python file.

    A module that is not found is searched in the folder of the file and in those above, where scripts of a repository
    import it from. Such modules are the file's own: two repositories may both have one of the same name.

    Returns:
        The module, and the files of the modules that were found in this way.

    Raises:
        UserError: the file is too large, or not a Python file. Other errors are those of the file.
    """
    if file.stat().st_size > LARGEST:
        raise UserError(f"{file} is larger than {LARGEST} bytes, the greatest size of a plugin file: split it")
    roots: list[Path] = []
    while True:
        try:
            with _importable(roots) as found:
                module = _executed(file)
            return module, found
        except ModuleNotFoundError as error:
            root = folder_of(error.name, file) if error.name else None
            if root is None or root in roots:
                raise
            roots.insert(0, root)


def _executed(file: Path) -> ModuleType:
    # With a hash of the path, two files of the same name get different names.
    name = f"{PREFIX}{file.stem}_{hashlib.sha256(str(file.resolve()).encode()).hexdigest()[:8]}"
    spec = importlib.util.spec_from_file_location(name, file)
    if spec is None or spec.loader is None:
        raise UserError(f"{file} is not a Python file: its name must end in .py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except BaseException:
        del sys.modules[name]
        raise
    return module


@contextmanager
def _importable(roots: list[Path]) -> Iterator[list[Path]]:
    """Let modules of some folders be imported, ahead of others; afterwards they are forgotten.

    Yields:
        Files of these modules; the list is filled when the context ends.
    """
    found: list[Path] = []
    if not roots:
        yield found
        return
    path, modules = list(sys.path), set(sys.modules)
    sys.path[:0] = map(str, roots)
    try:
        yield found
    finally:
        sys.path[:] = path
        # Found first: the path of a package inside of another one is computed from that of the outer.
        added = [name for name in set(sys.modules) - modules if not name.startswith(PREFIX)]
        origins = {name: _origin(sys.modules[name]) for name in added}
        for name, origin in origins.items():
            if origin is not None and any(origin.is_relative_to(root) for root in roots):
                del sys.modules[name]
                found += [origin] if origin.is_file() else []


def _origin(module: ModuleType) -> Path | None:
    """Return the file of a module, or the folder of a package without one."""
    origin = getattr(module, "__file__", None) or next(iter(getattr(module, "__path__", ())), None)
    return None if origin is None else Path(origin).resolve()
