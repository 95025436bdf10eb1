"""Discovery and loading of plugins. A broken plugin never stops the others.

pluggy's own entry-point loader is not used, since it stops at the first plugin that raises.
"""

import os
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import pluggy

from pcsr.errors import PcsrError, UserError, did_you_mean
from pcsr.plugins import hookspecs, renamed
from pcsr.plugins.code import GROUP, python_files
from pcsr.plugins.file_import import import_file
from pcsr.plugins.guard import guarded_import
from pcsr.plugins.networks import holds_networks
from pcsr.plugins.registry import FILE, Failure, Register, Registry, described
from pcsr.validation_messages import shown_path


def load_plugins(files: Iterable[Path] = (), *, files_win: bool = False) -> Registry:
    """Return a registry with the parts of all installed plugins and of plugin files.

    A plugin that fails to load is recorded in `Registry.failures`.

    Args:
        files: Python files.
        files_win: a part of a file replaces an installed part of the same name.

    Raises:
        UserError: one of the files does not exist.
    """
    registry = Registry(files=tuple(files), files_win=files_win)
    # If a distribution is on the path twice, as in nested environments, Python imports the first.
    installed: dict[str, Any] = {}
    for distribution in distributions():
        installed.setdefault(_name(distribution), distribution)
    for _, distribution in sorted(installed.items()):
        for point in distribution.entry_points:
            if point.group == GROUP:
                _register(registry, point.load, _name(distribution), distribution.version)
    for file in registry.files:
        if not os.path.isfile(file):  # unlike `Path.is_file`, it accepts names that no file can have
            raise UserError(f"--plugin {shown_path(file)}: there is no such file")
        _register(registry, partial(_imported, registry, file), str(file), FILE)
    return registry


def plugin_paths(plugins: Sequence[str | Path]) -> tuple[Path, ...]:
    """Return the paths of the plugin files that a function of the library was given.

    Raises:
        UserError: a text in place of a list, whose letters would be taken for files.
    """
    if isinstance(plugins, str | Path):
        raise UserError(f"plugins={str(plugins)!r} is one file: give a list, plugins=[{str(plugins)!r}]")
    return tuple(map(Path, plugins))


def add_file(registry: Registry, path: Path) -> None:
    """Load a Python file with the class of a network into a registry, unless it is there already.

    Raises:
        UserError: there is no such file, it cannot be imported, or another file of its name was loaded.
    """
    for known in registry.modules:
        if known.resolve() == path.resolve():
            return
        if known.name == path.name:
            raise UserError(
                f"{path} has the name of {known}, and weights know the file of their network by its name: rename one"
            )
    if not os.path.isfile(path):
        raise UserError(f"there is no file {shown_path(path)}")
    failed = len(registry.failures)
    _register(registry, partial(_imported, registry, path), str(path), FILE, with_parts=False)
    if len(registry.failures) > failed:
        failure = registry.failures.pop()
        raise UserError(f"{shown_path(path)} cannot be loaded: {failure.message}") from failure.error
    registry.files = (*registry.files, path)


def _imported(registry: Registry, file: Path) -> object:
    module, registry.imports[file] = import_file(file)
    registry.modules[file] = module
    return module


def check_loaded(registry: Registry) -> None:
    """Check that the plugin files were loaded.

    Raises:
        UserError: a file of `registry.files` failed to load.
    """
    named = {str(file) for file in registry.files}
    for failure in registry.failures:
        if failure.owner in named:
            where = f"pcsr plugins --why {failure.owner} --plugin {failure.owner}"
            message = f"plugin {failure.owner} cannot be loaded: {failure.message} (where: {where})"
            raise UserError(message) from failure.error


def _name(distribution: Any) -> str:
    # Untyped: after an import of the backport importlib_metadata it is an instance of that one's class.
    return str(distribution.metadata["Name"])


def _register(
    registry: Registry, load: Callable[[], object], owner: str, version: str, *, with_parts: bool = True
) -> None:
    """Load one plugin and add all its parts to the registry, or none of them and its failure.

    Without parts it fails if it is to be `with_parts`, unless it is a file with networks.
    """
    before, modules = dict(registry.entries), dict(registry.modules)
    try:
        with guarded_import(f"plugin {owner}"):
            manager = pluggy.PluginManager("pcsr")
            manager.add_hookspecs(hookspecs)
            module = load()
            manager.register(module)
            manager.check_pending()  # raises for a misspelt hook name
            if not manager.hook.pcsr_register.get_hookimpls():
                if not with_parts or (version == FILE and holds_networks(module)):
                    return
                raise UserError("it has no function pcsr_register marked @pcsr.hookimpl, so it registers nothing")
            manager.hook.pcsr_register(register=Register(registry, owner, version))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit too: a plugin must not end the process
        registry.entries, registry.modules = before, modules
        old = renamed.old_names(python_files(owner, in_file=version == FILE))
        if old:
            error = UserError(f"{old} ({described(error)})").with_traceback(error.__traceback__)
        registry.failures.append(Failure(owner, version, error))


def why(registry: Registry, name: str) -> str:
    """Explain where a part or plugin comes from, or why a plugin failed, as `pcsr plugins --why NAME` prints it.

    Raises:
        UserError: no plugin is called so or registers such a part; the message lists the plugins that failed to load.
    """
    lines = [
        f"{e.kind} '{e.name}' comes from {e.owner} {e.version} ({_where(e.target)})"
        for e in registry
        if name in (e.name, e.owner)
    ]
    failures = [f for f in registry.failures if name == f.owner]
    unknown = not lines and not failures
    if unknown:
        known = {entry.name for entry in registry} | {entry.owner for entry in registry}
        meant = did_you_mean(name, sorted(known))
        hint = f": {meant}" if meant.startswith("did") else "; a part in a file needs --plugin FILE"
        lines.append(f"no installed plugin registers a part or is called '{name}'{hint}")
        failures = registry.failures
    for failure in failures:
        lines.append(f"{failure.owner} {failure.version} failed to load: {failure.message}")
        if not isinstance(failure.error, PcsrError):
            lines.append(_location(failure.error))
    if unknown:
        raise UserError("\n".join(lines))
    return "\n".join(lines)


def _where(target: type | str) -> str:
    return target if isinstance(target, str) else target.__name__


def _location(error: BaseException) -> str:
    """Return the file and line at which an error was raised."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    if isinstance(error, SyntaxError):
        return f"  at {error.filename}:{error.lineno}"
    return f"  at {trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}" if trace else ""
