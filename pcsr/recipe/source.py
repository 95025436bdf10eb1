"""A recipe's file as plain data, with the place of every key and value. YAML 1.2: no Python, no environment."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.error import MarkedYAMLError

from pcsr.errors import UserError

Keys = tuple[str | int, ...]
"""The way to a value: ("model", "encoder", "channels")."""


class Place(NamedTuple):
    """Where something stands: file (or command-line option), line and column from 1; 0 where there are none."""

    origin: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.origin}:{self.line}:{self.column}" if self.line else self.origin


class Mistake(NamedTuple):
    """One thing that is wrong, and the fix."""

    place: Place
    text: str

    def __str__(self) -> str:
        return f"{self.place}: {self.text}"


class RecipeError(UserError):
    """All mistakes of a recipe, a line each, in the order of the file."""

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes = sorted(set(mistakes))
        super().__init__("\n".join(map(str, self.mistakes)))


@dataclass
class Source:
    """Plain data and where each piece of it stands."""

    data: dict[str, Any]
    values: dict[Keys, Place] = field(default_factory=dict)
    names: dict[Keys, Place] = field(default_factory=dict)
    """Of keys rather than their values: an unknown key is marked itself."""

    def place(self, keys: Keys, *, of_name: bool = False) -> Place:
        """Where a value stands; if it isn't written anywhere, where the nearest thing around it does."""
        known = self.names if of_name else self.values
        if keys in known:
            return known[keys]
        while keys not in self.values:
            keys = keys[:-1]
        return self.values[keys]


def read(path: Path) -> Source:
    """Read a recipe file.

    Raises:
        UserError: there is no such file, or it is not text.
        RecipeError: it is not YAML, or not a mapping.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise UserError(f"recipe {path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UserError(f"recipe {path} is not UTF-8 text: {error.reason} at byte {error.start}") from error
    return parse(text, str(path))


def parse(text: str, origin: str) -> Source:
    """Read a recipe's text; `origin` names it in messages."""
    try:
        tree = YAML(typ="rt").load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = Place(origin, mark.line + 1, mark.column + 1) if mark else Place(origin)
        what = (error.problem or "not YAML").partition(" with value")[0]
        raise RecipeError([Mistake(place, f"{what}: mend the YAML there")]) from error
    if not isinstance(tree, CommentedMap):
        raise RecipeError([Mistake(Place(origin, 1, 1), "a recipe is a mapping: it starts with `name: …`")])
    source = Source({}, {(): Place(origin, 1, 1)})
    source.data = _plain(tree, (), source, origin)
    return source


def scalar(text: str) -> Any:
    """A value given on the command line, read as YAML."""
    try:
        return _plain(YAML(typ="rt").load(text), (), Source({}), "")
    except MarkedYAMLError as error:
        raise UserError(f"'{text}' is not YAML: {error.problem}") from error


def _plain(node: Any, keys: Keys, source: Source, origin: str) -> Any:
    """Ruamel's tree without its types, which only look like Python's; places go into `source`."""
    if isinstance(node, CommentedMap):
        for key in node:
            line, column, value_line, value_column = node.lc.data[key]
            source.names[(*keys, str(key))] = Place(origin, line + 1, column + 1)
            source.values[(*keys, str(key))] = Place(origin, value_line + 1, value_column + 1)
        return {str(key): _plain(value, (*keys, str(key)), source, origin) for key, value in node.items()}
    if isinstance(node, CommentedSeq):
        for index in range(len(node)):
            line, column = node.lc.data[index][:2]
            source.values[(*keys, index)] = Place(origin, line + 1, column + 1)
        return [_plain(value, (*keys, index), source, origin) for index, value in enumerate(node)]
    for plain in (bool, int, float, str):  # bool first: it is an int
        if isinstance(node, plain):
            return plain(node)
    return node
