"""Environment of a run, for its run folder: command, versions of packages, git commits, and copies of plugin files."""

import datetime
import json
import os
import platform
import shutil
import subprocess
from collections.abc import Iterable
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import pcsr
from pcsr.errors import UserError
from pcsr.files import write_bytes, write_text
from pcsr.plugins.code import file_code, python_files
from pcsr.plugins.networks import find_network
from pcsr.plugins.registry import FILE, Entry, Registry
from pcsr.recipe import PARTS, Recipe
from pcsr.recipe.part_keys import NAMES, PART_LISTS, owner_of
from pcsr.recipe.schema import GraftedModel
from pcsr.run_files import ENVIRONMENT, PLUGINS, RECIPE, read_environment

GIT_SECONDS = 10
"""Time limit of a call of git, which may be slow on a large repository."""


def record(folder: Path, stage: str, recipe: Recipe, registry: Registry, command: str | None) -> None:
    """Write what repeats a run into its folder: the resolved recipe, the environment, and the plugin files it uses.

    Args:
        folder: run folder.
        stage: "training" or "evaluation"; each has a section of its own in the file of the environment.
        recipe: recipe of the run.
        registry: installed parts.
        command: command line of the run; None if it was started from Python.

    Raises:
        RunError: a file can't be written.
    """
    files = plugin_files(recipe, registry)
    write_text(folder / RECIPE, json.dumps(recipe.resolved(), indent=1))
    imports = {file.resolve(): found for file, found in registry.imports.items()}
    plugins = {}
    for name, file in files.items():
        others = imports.get(file, [])
        modules = {*python_files(str(file), in_file=True), *others}
        top = Path(os.path.commonpath([path.parent for path in modules]))
        for path in modules:
            write_bytes(folder / PLUGINS / name / path.relative_to(top), path.read_bytes())
        plugins[f"{PLUGINS}/{name}/{file.relative_to(top).as_posix()}"] = file_code(file, others)
    about = environment(command, [Path.cwd(), *(file.parent for file in files.values())]) | {"plugins": plugins}
    write_environment(folder, stage, about)


def write_environment(folder: Path, stage: str, about: dict[str, Any]) -> None:
    """Write the environment of a stage into a run folder; that of the other stage is kept.

    Raises:
        RunError: the file can't be written.
    """
    try:
        before = read_environment(folder)
    except UserError:  # damaged, and replaced
        before = {}
    write_text(folder / ENVIRONMENT, json.dumps({**before, stage: about}, indent=1))


def environment(command: str | None, folders: Iterable[Path]) -> dict[str, Any]:
    """Return command, time, versions and commits as plain data.

    Args:
        command: command line of the run; None if it was started from Python.
        folders: folders whose git repositories are named, if they are in any.
    """
    found = {one.metadata["Name"]: one.version for one in distributions() if one.metadata["Name"]}
    commits = (commit(folder) for folder in dict.fromkeys(folder.resolve() for folder in folders))
    return {
        "time": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "command": command,
        "pcsr": pcsr.__version__,
        "python": platform.python_version(),
        "system": f"{platform.system()} {platform.machine()}",
        "packages": {name: found[name] for name in sorted(found, key=str.lower)},
        "git": list({one["commit"]: one for one in commits if one is not None}.values()),
    }


def commit(folder: Path) -> dict[str, Any] | None:
    """Return the name of a folder's git repository, its commit, and whether files have changed since."""
    top = _git(folder, "rev-parse", "--show-toplevel")
    head = _git(folder, "rev-parse", "--verify", "HEAD")
    if not top or not head:
        return None
    status = _git(folder, "--no-optional-locks", "status", "--porcelain")
    changed = None if status is None else bool(status)
    return {"repository": Path(top.strip()).name, "commit": head.strip(), "changed": changed}


def _git(folder: Path, *words: str) -> str | None:
    """Return the output of git, or None if there is no git, or it fails."""
    git = shutil.which("git")
    if git is None:
        return None
    try:
        done = subprocess.run(
            [git, "-C", str(folder), *words], capture_output=True, text=True, timeout=GIT_SECONDS, check=False
        )
    except (OSError, subprocess.SubprocessError, UnicodeDecodeError):
        return None
    return done.stdout if done.returncode == 0 else None


def plugin_files(recipe: Recipe, registry: Registry) -> dict[str, Path]:
    """Return the plugin files whose parts or network a recipe names, by a name that no other file has."""
    owners = [Path(entry.owner) for entry in _entries(recipe, registry) if entry.version == FILE]
    if isinstance(recipe.model, GraftedModel):
        owners.append(find_network(registry, recipe.model.graft.network)[0])
    files: dict[str, Path] = {}
    for file in dict.fromkeys(owner.resolve() for owner in owners):
        name, number = file.stem, 2
        while name in files:
            name, number = f"{file.stem}-{number}", number + 1
        files[name] = file
    return files


def _entries(recipe: Recipe, registry: Registry) -> list[Entry]:
    """Return the parts that a recipe names, as far as they are registered."""
    data, named = recipe.resolved(), []
    for keys, kind in PARTS.items():
        spec = (owner_of(data, keys) or {}).get(str(keys[-1]))
        named += [] if spec is None else [(kind, spec["use"])]
    for keys, kind in (NAMES | PART_LISTS).items():
        listed = (owner_of(data, keys) or {}).get(str(keys[-1])) or ()
        named += [(kind, one["use"] if isinstance(one, dict) else one) for one in listed]
    return [registry.entries[part] for part in dict.fromkeys(named) if part in registry.entries]
