"""Finding plugins and letting them register. One that is broken never stops the others.

pluggy's own entry-point loader ends at the first plugin that raises, hence the short loop here.
"""

import hashlib
import importlib.util
import os
import sys
import warnings
from collections.abc import Callable, Iterable
from functools import partial
from importlib.metadata import distributions
from pathlib import Path
from types import ModuleType
from typing import Any

import pluggy

from pcsr.errors import PcsrError, PcsrWarning, UserError, did_you_mean
from pcsr.plugins import hookspecs, renamed
from pcsr.plugins.code import GROUP, python_files
from pcsr.plugins.guard import guarded_import
from pcsr.plugins.registry import FILE, Failure, Register, Registry
from pcsr.validation_messages import shown_path

LARGEST = 1 << 24
"""Bytes of a plugin file; Python reads it whole."""


def load_plugins(files: Iterable[Path] = (), *, files_win: bool = False) -> Registry:
    """A registry with the parts of every installed plugin and of each plugin file in `files`.

    Args:
        files: of Python.
        files_win: a part of a file takes the place of an installed one of the same name.

    Raises:
        UserError: a file is not there. A plugin that fails in any other way becomes a `Failure`.
    """
    registry = Registry(files=tuple(files), files_win=files_win)
    # Of a distribution that is on the path twice, as in one environment on top of another, the first is imported.
    installed: dict[str, Any] = {}
    for distribution in distributions():
        installed.setdefault(_name(distribution), distribution)
    for _, distribution in sorted(installed.items()):
        for point in distribution.entry_points:
            if point.group == GROUP:
                _register(registry, point.load, _name(distribution), distribution.version)
    for file in registry.files:
        if not os.path.isfile(file):  # of a name that no file can have, too
            raise UserError(f"--plugin {shown_path(file)}: there is no such file")
        _register(registry, partial(_import_file, file), str(file), FILE)
    return registry


def warn_of_failures(registry: Registry) -> None:
    """Say which plugin files failed to load: whoever names one wants its parts.

    Warns:
        PcsrWarning: one did.
    """
    named = {str(file) for file in registry.files}
    for failure in registry.failures:
        if failure.owner in named:
            why = f"pcsr plugins --why {failure.owner} --plugin {failure.owner}"
            warnings.warn(f"--plugin {failure.owner} failed to load: {failure.said} ({why})", PcsrWarning, stacklevel=3)


def _name(distribution: Any) -> str:
    # Not `Distribution`: where the backport importlib_metadata was imported, it gives those of its own class.
    return str(distribution.metadata["Name"])


def _register(registry: Registry, load: Callable[[], object], owner: str, version: str) -> None:
    """Load one plugin into the registry whole, or note its failure and leave the registry as it was."""
    before = dict(registry.entries)
    try:
        with guarded_import(f"plugin {owner}"):
            manager = pluggy.PluginManager("pcsr")
            manager.add_hookspecs(hookspecs)
            manager.register(load())
            manager.check_pending()  # a misspelt hook name is an error, not silence
            if not manager.hook.pcsr_register.get_hookimpls():
                raise UserError("it has no function pcsr_register marked @pcsr.hookimpl, so it registers nothing")
            manager.hook.pcsr_register(register=Register(registry, owner, version))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a plugin that calls sys.exit must not end the rest
        registry.entries = before
        old = renamed.old_names(python_files(owner, in_file=version == FILE))
        if old:
            error = UserError(old).with_traceback(error.__traceback__)
        registry.failures.append(Failure(owner, version, error))


def _import_file(file: Path) -> ModuleType:
    if file.stat().st_size > LARGEST:
        raise UserError(f"{file} is larger than {LARGEST} bytes, which no Python file is that a person wrote")
    # A name of its own, so that two files called fusion.py don't collide.
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


def why(registry: Registry, name: str) -> str:
    """Why a part or plugin is or isn't there, as `pcsr plugins --why NAME` prints it."""
    lines = [
        f"{e.kind} '{e.name}' comes from {e.owner} {e.version} ({_where(e.target)})"
        for e in registry
        if name in (e.name, e.owner)
    ]
    failures = [f for f in registry.failures if name == f.owner]
    if not lines and not failures:
        known = {entry.name for entry in registry} | {entry.owner for entry in registry}
        meant = did_you_mean(name, sorted(known))
        hint = f": {meant}" if meant.startswith("did") else "; a part in a file needs --plugin FILE"
        lines.append(f"no installed plugin registers a part or is called '{name}'{hint}")
        failures = registry.failures
    for failure in failures:
        lines.append(f"{failure.owner} {failure.version} failed to load: {failure.said}")
        if not isinstance(failure.error, PcsrError):
            lines.append(_place(failure.error))
    return "\n".join(lines)


def _where(target: type | str) -> str:
    return target if isinstance(target, str) else target.__name__


def _place(error: BaseException) -> str:
    """The file and line where a plugin failed, without our own frames."""
    place = error.__traceback__
    while place is not None and place.tb_next is not None:
        place = place.tb_next
    if isinstance(error, SyntaxError):
        return f"  at {error.filename}:{error.lineno}"
    return f"  at {place.tb_frame.f_code.co_filename}:{place.tb_lineno}" if place else ""
