"""Registry of parts by kind and name, with the plugin that registered each."""

import functools
import importlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pcsr.errors import UserError, did_you_mean
from pcsr.plugins import renamed
from pcsr.plugins.code import distribution_code, file_code, python_files
from pcsr.plugins.guard import guarded_import
from pcsr.validation_messages import LONGEST, shortened, shown

KINDS = {
    "encoder": "Encoder",
    "fusion": "Fusion",
    "backbone": "Backbone",
    "upsampler": "Upsampler",
    "objective": "Objective",
    "touch": "TouchSource",
    "shapes": "ShapeSource",
    "metric": "Metric",
    "baseline": "Baseline",
    "logger": "Logger",
    "policy": "Policy",
}
"""Kinds of parts, each with the name of its class in `pcsr.contracts`; that module imports torch, this one does not."""
FIRST_PARTY = "pcsr"
"""Distribution that contains pcsr's own parts."""
FILE = "file"
"""Version of a part that a plugin file registers."""


NAME = r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}"
"""Pattern of a part's name, which is used in recipes, on command lines and in the names of run folders."""


@dataclass(frozen=True)
class Entry:
    """Registered part."""

    kind: str
    name: str
    target: type | str
    """The part's class, or text ``"module:Class"``, which `load` imports."""
    owner: str
    """Name of the distribution, or path of the plugin file, that registered the part."""
    version: str
    """Version of the distribution, or `FILE`."""

    @property
    def brought_by(self) -> str:
        """Name of the distribution, or of the plugin file without its folder."""
        return Path(self.owner).name if self.version == FILE else self.owner

    @functools.cached_property
    def code(self) -> str | None:
        """Identifier of the part's code, which changes with it.

        For third-party parts, a hash of the plugin's files, or None if the files are not found. For pcsr's own parts,
        their version, such as "version 2", or None for version 1.
        """
        if self.owner == FIRST_PARTY:
            version = self.load().version  # type: ignore[attr-defined]  # every kind of part has one
            return f"version {version}" if version > 1 else None
        return file_code(Path(self.owner)) if self.version == FILE else distribution_code(self.owner)

    def load(self) -> type:
        """Return the part's class, and import it if needed.

        Raises:
            UserError: the class cannot be imported, or is not a part of this kind.
        """
        part = self.target
        if isinstance(part, str):
            module, _, attribute = part.partition(":")
            try:
                with guarded_import(f"{self.kind} '{self.name}' of {self.owner}"):
                    part = getattr(importlib.import_module(module), attribute)
            except (Exception, SystemExit) as error:
                old = renamed.old_names(python_files(self.owner, in_file=self.version == FILE))
                why = f"{old} ({described(error)})" if old else described(error)
                raise UserError(
                    f"{self.kind} '{self.name}' of {self.owner} cannot be loaded from '{self.target}': {why}"
                ) from error
        contract = getattr(importlib.import_module("pcsr.contracts"), KINDS[self.kind])
        if not (isinstance(part, type) and issubclass(part, contract)):
            raise UserError(
                f"{self.kind} '{self.name}' of {self.owner} is {shown(part)}, which is not a {contract.__name__}: "
                f"derive it from pcsr.{contract.__name__}"
            )
        renamed.check_class(part)
        return part


def described(error: BaseException) -> str:
    """Describe an error of a plugin in one line."""
    try:
        text = " ".join(str(error).split())
    except Exception:  # the error's own `__str__` failed
        text = ""
    return f"{type(error).__name__}: {shortened(text, 500)}" if text else type(error).__name__


@dataclass(frozen=True)
class Failure:
    """Plugin that failed to load, with its error."""

    owner: str
    version: str
    error: BaseException

    @property
    def message(self) -> str:
        """The error in one line."""
        return described(self.error)


@dataclass(eq=False)
class Registry:
    """Parts of all plugins, as `pcsr.plugins.loading.load_plugins` returns them."""

    entries: dict[tuple[str, str], Entry] = field(default_factory=dict)
    """Registered parts by kind and name."""
    failures: list[Failure] = field(default_factory=list)
    """Plugins that failed to load."""
    files: tuple[Path, ...] = ()
    """Plugin files that were loaded, and that worker processes must load too."""
    modules: dict[Path, object] = field(default_factory=dict)
    """Modules of the plugin files that were loaded."""
    imports: dict[Path, list[Path]] = field(default_factory=dict)
    """Files that each plugin file imports from the folders above it."""
    files_win: bool = False
    """Whether a part of a file replaces an installed part of the same name. Otherwise that is an error."""

    def __iter__(self) -> Iterator[Entry]:
        return iter(sorted(self.entries.values(), key=lambda e: (list(KINDS).index(e.kind), e.name)))

    def names(self, kind: str) -> list[str]:
        """Return the names of all parts of a kind, sorted."""
        return sorted(name for k, name in self.entries if k == kind)

    def add(self, entry: Entry) -> None:
        """Add a part.

        Raises:
            UserError: the kind is unknown, the name is invalid or taken, or the target is neither a class nor text.
        """
        if not (isinstance(entry.name, str) and re.fullmatch(NAME, entry.name)):
            raise UserError(
                f"{shown(entry.name)} is no valid name for a part ({entry.kind} of {entry.owner}): use 1 to 100 "
                f"letters, digits, '.', '_' and '-', and begin with a letter or digit"
            )
        if not isinstance(entry.target, type | str):
            raise UserError(
                f"{entry.kind} '{entry.name}' of {entry.owner} is {shown(entry.target)}: register its class, or the "
                f"text 'module:Class'"
            )
        if entry.kind not in KINDS:
            raise UserError(f"'{entry.kind}' is not a kind of part: {did_you_mean(entry.kind, KINDS)}")
        if (entry.kind, entry.name) in renamed.PARTS:
            raise UserError(
                f"{entry.kind} '{entry.name}' of {entry.owner} has the name that "
                f"'{renamed.PARTS[entry.kind, entry.name]}' had in pcsr 0.1, and recipes mean that one: rename it"
            )
        taken = self.entries.get((entry.kind, entry.name))
        wins = self.files_win and entry.version == FILE and taken is not None and taken.version != FILE
        if taken is not None and not wins:
            raise UserError(
                f"{entry.kind} '{entry.name}' is registered twice, by {taken.owner} and by {entry.owner}: "
                f"rename one of them"
            )
        self.entries[entry.kind, entry.name] = entry

    def get(self, kind: str, name: str) -> type[Any]:
        """Return the class of a part.

        Raises:
            UserError: there is no such part. The message suggests the closest name, and lists plugins that failed.
        """
        entry = self.entries.get((kind, name))
        if entry is None:
            failed = ", ".join(f.owner for f in self.failures)
            hint = f" (these plugins failed to load: {failed}; see `pcsr plugins --why {name}`)" if failed else ""
            meant = did_you_mean(name[:LONGEST], self.names(kind))
            raise UserError(f"there is no {kind} '{shortened(name)}': {meant}{hint}")
        return entry.load()


@dataclass(frozen=True)
class Register:
    """Argument of a plugin's hook, with one method for each kind of part.

    Examples:
        >>> @pcsr.hookimpl
        ... def pcsr_register(register: pcsr.Register) -> None:
        ...     register.encoder("my-encoder", "my_package.parts:MyEncoder")
        ...     register.fusion("my-fusion", "my_package.parts:MyFusion")
        ...     register.backbone("my-backbone", "my_package.parts:MyBackbone")
        ...     register.upsampler("my-upsampler", "my_package.parts:MyUpsampler")
        ...     register.objective("my-objective", "my_package.parts:MyObjective")
        ...     register.touch("my-touch", "my_package.parts:MyTouch")
        ...     register.shapes("my-shapes", "my_package.parts:MyShapes")
        ...     register.metric("my-metric", "my_package.parts:MyMetric")
        ...     register.baseline("my-baseline", "my_package.parts:MyBaseline")
        ...     register.logger("my-logger", "my_package.parts:MyLogger")
        ...     register.policy("my-policy", "my_package.parts:MyPolicy")
    """

    registry: Registry
    owner: str
    version: str

    def _add(self, kind: str, name: str, target: type | str) -> None:
        self.registry.add(Entry(kind, name, target, self.owner, self.version))

    def encoder(self, name: str, part: type | str) -> None:
        """Register an encoder."""
        self._add("encoder", name, part)

    def fusion(self, name: str, part: type | str) -> None:
        """Register a fusion."""
        self._add("fusion", name, part)

    def backbone(self, name: str, part: type | str) -> None:
        """Register a backbone."""
        self._add("backbone", name, part)

    def upsampler(self, name: str, part: type | str) -> None:
        """Register an upsampler."""
        self._add("upsampler", name, part)

    def objective(self, name: str, part: type | str) -> None:
        """Register an objective."""
        self._add("objective", name, part)

    def touch(self, name: str, part: type | str) -> None:
        """Register a touch source."""
        self._add("touch", name, part)

    def shapes(self, name: str, part: type | str) -> None:
        """Register a shape source."""
        self._add("shapes", name, part)

    def metric(self, name: str, part: type | str) -> None:
        """Register a metric."""
        self._add("metric", name, part)

    def baseline(self, name: str, part: type | str) -> None:
        """Register a baseline."""
        self._add("baseline", name, part)

    def logger(self, name: str, part: type | str) -> None:
        """Register a logger."""
        self._add("logger", name, part)

    def policy(self, name: str, part: type | str) -> None:
        """Register a policy."""
        self._add("policy", name, part)
