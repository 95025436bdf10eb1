"""The registry: an object that knows each part by its kind and name, and who brought it."""

import functools
import importlib
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pcsr.errors import UserError, did_you_mean
from pcsr.mistakes import LONGEST, shortened, shown
from pcsr.plugins.code import distribution_code, file_code
from pcsr.plugins.guard import guarded_import

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
}
"""Each kind of part and the name of its class in pcsr.contracts (which imports torch; this file does not)."""
OURS = "pcsr"
"""The distribution whose parts everybody has."""
FILE = "file"
"""The version of a part that came from a file, not from an installed distribution."""


NAME = r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}"
"""Of a part: it stands in recipes, on command lines and in the names of run folders."""


@dataclass(frozen=True)
class Entry:
    """One registered part: `target` is its class, or text ``"module:Class"`` that is imported when asked for."""

    kind: str
    name: str
    target: type | str
    owner: str
    version: str

    @property
    def brought_by(self) -> str:
        """The distribution, or the name of the plugin file without the folders that it lies in."""
        return Path(self.owner).name if self.version == FILE else self.owner

    @functools.cached_property
    def code(self) -> str | None:
        """What tells the part's code from other code of the same name.

        A hash of the plugin's files; of a part of pcsr "version 2", say. None of such a part at version 1, and where
        the files are not known.
        """
        if self.owner == OURS:
            version = self.load().version  # type: ignore[attr-defined]  # every kind of part has one
            return f"version {version}" if version > 1 else None
        return file_code(Path(self.owner)) if self.version == FILE else distribution_code(self.owner)

    def load(self) -> type:
        """The part's class.

        Raises:
            UserError: it cannot be imported, or is not a part of this kind.
        """
        part = self.target
        if isinstance(part, str):
            module, _, attribute = part.partition(":")
            try:
                with guarded_import(f"{self.kind} '{self.name}' of {self.owner}"):
                    part = getattr(importlib.import_module(module), attribute)
            except (Exception, SystemExit) as error:
                raise UserError(
                    f"{self.kind} '{self.name}' of {self.owner} cannot be loaded from '{self.target}': "
                    f"{described(error)}"
                ) from error
        contract = getattr(importlib.import_module("pcsr.contracts"), KINDS[self.kind])
        if not (isinstance(part, type) and issubclass(part, contract)):
            raise UserError(
                f"{self.kind} '{self.name}' of {self.owner} is {shown(part)}, which is not a {contract.__name__}: "
                f"derive it from pcsr.{contract.__name__}"
            )
        return part


def described(error: BaseException) -> str:
    """An error of a plugin in one line, whatever its text is."""
    try:
        text = " ".join(str(error).split())
    except Exception:  # the author's `__str__`
        text = ""
    return f"{type(error).__name__}: {shortened(text, 500)}" if text else type(error).__name__


@dataclass(frozen=True)
class Failure:
    """A plugin that could not be loaded. It stops nobody else; its error is kept to be shown and raised."""

    owner: str
    version: str
    error: BaseException

    @property
    def said(self) -> str:
        """The error in one line."""
        return described(self.error)


@dataclass
class Registry:
    """All parts of one process. Made by `pcsr.plugins.loading.load_plugins`, handed to whoever needs parts."""

    entries: dict[tuple[str, str], Entry] = field(default_factory=dict)
    failures: list[Failure] = field(default_factory=list)
    files: tuple[Path, ...] = ()
    """Plugin files that were loaded: another process has to load them too."""
    files_win: bool = False
    """Whether a part of a file takes the place of an installed one of the same name, which is else a mistake."""

    def __iter__(self) -> Iterator[Entry]:
        return iter(sorted(self.entries.values(), key=lambda e: (list(KINDS).index(e.kind), e.name)))

    def names(self, kind: str) -> list[str]:
        """The names of all parts of a kind, sorted."""
        return sorted(name for k, name in self.entries if k == kind)

    def add(self, entry: Entry) -> None:
        """Add a part; one of a file takes the place of an installed one where `files_win`.

        Raises:
            UserError: the kind is unknown, the name is none or taken, or there is no class; the owner is named.
        """
        if not (isinstance(entry.name, str) and re.fullmatch(NAME, entry.name)):
            raise UserError(
                f"{shown(entry.name)} is no name for the {entry.kind} of {entry.owner}: take up to 100 letters, "
                f"digits, '.', '_' and '-', the first a letter or a digit"
            )
        if not isinstance(entry.target, type | str):
            raise UserError(
                f"{entry.kind} '{entry.name}' of {entry.owner} is {shown(entry.target)}: register its class, or text "
                f"'module:Class' that says where it is"
            )
        if entry.kind not in KINDS:
            raise UserError(f"'{entry.kind}' is not a kind of part: {did_you_mean(entry.kind, KINDS)}")
        taken = self.entries.get((entry.kind, entry.name))
        wins = self.files_win and entry.version == FILE and taken is not None and taken.version != FILE
        if taken is not None and not wins:
            raise UserError(
                f"{entry.kind} '{entry.name}' is registered twice, by {taken.owner} and by {entry.owner}: "
                f"rename one of them"
            )
        self.entries[entry.kind, entry.name] = entry

    def get(self, kind: str, name: str) -> type[Any]:
        """The class of a part.

        Raises:
            UserError: no such part; the message offers the closest name and lists plugins that failed.
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
    """What a plugin's hook is given: one method for each kind of part."""

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
        """Register a source of shapes."""
        self._add("shapes", name, part)

    def metric(self, name: str, part: type | str) -> None:
        """Register a metric."""
        self._add("metric", name, part)

    def baseline(self, name: str, part: type | str) -> None:
        """Register a baseline."""
        self._add("baseline", name, part)
