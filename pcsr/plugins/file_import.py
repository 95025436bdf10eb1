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


def import_file(file: Path) -> ModuleType:
    """Import a Python file.

    A module that is not found is searched in the folder of the file and in those above, where scripts of a repository
    import it from. Such modules are the file's own: two repositories may both have one of the same name.

    Raises:
        UserError: the file is too large, or not a Python file. Other errors are those of the file.
    """
    if file.stat().st_size > LARGEST:
        raise UserError(f"{file} is larger than {LARGEST} bytes, the greatest size of a plugin file: split it")
    roots: list[Path] = []
    while True:
        try:
            with _importable(roots):
                return _executed(file)
        except ModuleNotFoundError as error:
            root = folder_of(error.name, file) if error.name else None
            if root is None or root in roots:
                raise
            roots.insert(0, root)


def _executed(file: Path) -> ModuleType:
    # With a hash of the path, two files of the same name get different names.
    name = f"pcsr_plugin_{file.stem}_{hashlib.sha256(str(file.resolve()).encode()).hexdigest()[:8]}"
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
def _importable(roots: list[Path]) -> Iterator[None]:
    """Let modules of some folders be imported, ahead of others; afterwards they are forgotten."""
    if not roots:
        yield
        return
    path, modules = list(sys.path), set(sys.modules)
    sys.path[:0] = map(str, roots)
    try:
        yield
    finally:
        sys.path[:] = path
        for name in set(sys.modules) - modules:
            if not name.startswith("pcsr_plugin_") and _is_inside(sys.modules[name], roots):
                del sys.modules[name]


def _is_inside(module: ModuleType, roots: list[Path]) -> bool:
    """Return whether the file or the folder of a module is in one of some folders."""
    origin = getattr(module, "__file__", None) or next(iter(getattr(module, "__path__", ())), None)
    return origin is not None and any(Path(origin).resolve().is_relative_to(root) for root in roots)
