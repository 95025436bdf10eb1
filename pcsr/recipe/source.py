"""A recipe's file as plain data with the place of each key and value. YAML 1.2: no Python, no environment."""

import copy
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.constructor import RoundTripConstructor
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.scalarbool import ScalarBoolean

from pcsr.errors import UserError

Keys = tuple[str | int, ...]
"""The way to a value: ("model", "encoder", "channels")."""


class Place(NamedTuple):
    """Where something stands: file or command-line option, line and column from 1; 0 where there are none."""

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
    mistakes: list[Mistake] = field(default_factory=list)
    """What was wrong already in the writing; reported together with what is wrong in the meaning."""

    def copy(self) -> "Source":
        """The same, to be changed without changing this one."""
        return Source(copy.deepcopy(self.data), dict(self.values), dict(self.names), list(self.mistakes))

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
    """Read a recipe's text; `origin` names it in messages.

    Raises:
        RecipeError: it is not YAML, or not a mapping.
    """
    tree, twice = _load(text, origin)
    if not isinstance(tree, CommentedMap):
        raise RecipeError([Mistake(Place(origin, 1, 1), "a recipe is a mapping: it starts with `name: …`")])
    source = Source({}, {(): Place(origin, 1, 1)}, mistakes=twice)
    source.data = _plain(tree, (), source)
    return source


def scalar(text: str, place: Place) -> Any:
    """A value given on the command line, read as YAML.

    Raises:
        RecipeError: it is not YAML.
    """
    try:
        tree, twice = _load(text, place.origin)
    except RecipeError as error:
        raise RecipeError([Mistake(place, error.mistakes[0].text)]) from error
    source = Source({}, {(): place}, mistakes=twice)
    value = _plain(tree, (), source)
    if source.mistakes:
        raise RecipeError([Mistake(place, source.mistakes[0].text)])
    return value


class _Constructor(RoundTripConstructor):
    """Notes each key that is written twice, where ruamel's own ends at the first."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.twice: list[tuple[Any, Any]] = []

    def check_mapping_key(self, node: Any, key_node: Any, mapping: Any, key: Any, value: Any) -> bool:
        """Whether the key is the first of its name; only then its value is taken."""
        if key in mapping:
            self.twice.append((key, key_node.start_mark))
        return key not in mapping


def _load(text: str, origin: str) -> tuple[Any, list[Mistake]]:
    """Ruamel's tree, and the keys that are written twice."""
    yaml = YAML(typ="rt")
    yaml.Constructor = _Constructor
    try:
        tree = yaml.load(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = Place(origin, mark.line + 1, mark.column + 1) if mark else Place(origin)
        what = error.problem or "not YAML"
        raise RecipeError([Mistake(place, f"{what}: mend the YAML there")]) from error
    except (YAMLError, ValueError) as error:  # a control character, a thirteenth month: no mark
        raise RecipeError([Mistake(Place(origin), f"not YAML: {str(error).splitlines()[0]}")]) from error
    except RecursionError as error:
        raise RecipeError([Mistake(Place(origin), "nested too deeply: write it flatter")]) from error
    return tree, [
        Mistake(Place(origin, mark.line + 1, mark.column + 1), f"'{key}' is written twice: remove one of the two")
        for key, mark in yaml.constructor.twice
    ]


def _plain(node: Any, keys: Keys, source: Source, around: tuple[int, ...] = ()) -> Any:
    """Ruamel's tree without its types, which only look like Python's; places go into `source`."""
    if id(node) in around:
        source.mistakes.append(Mistake(source.place(keys), "an alias inside of what it stands for: write it out"))
        return None
    tag = getattr(getattr(node, "tag", None), "value", None)
    if tag is not None:
        source.mistakes.append(Mistake(source.place(keys), f"recipes are plain data: remove the tag {tag}"))
        return None
    if isinstance(node, CommentedMap):
        origin = source.place(keys).origin
        plain: dict[str, Any] = {}
        for key, value in node.items():
            here = (*keys, str(key))
            if key in node.lc.data:  # a key that `<<` merged in has its place elsewhere
                line, column, value_line, value_column = node.lc.data[key]
                source.names[here] = Place(origin, line + 1, column + 1)
                source.values[here] = Place(origin, value_line + 1, value_column + 1)
            plain[str(key)] = _plain(value, here, source, (*around, id(node)))
        return plain
    if isinstance(node, CommentedSeq):
        origin = source.place(keys).origin
        for index in range(len(node)):
            line, column = node.lc.data[index][:2]
            source.values[(*keys, index)] = Place(origin, line + 1, column + 1)
        return [_plain(value, (*keys, i), source, (*around, id(node))) for i, value in enumerate(node)]
    if isinstance(node, bool | ScalarBoolean):  # before int, which both are
        return bool(node)
    for kind in (int, float, str):
        if isinstance(node, kind):
            return kind(node)
    if node is not None:
        text = f"a {type(node).__name__.lower()} is not plain data: put it in quotes if text is meant"
        source.mistakes.append(Mistake(source.place(keys), text))
    return None
