"""Reading of recipe files: plain data with the location of each key and value. Plain YAML 1.2, without object tags."""

import copy
import os
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.error import MarkedYAMLError, YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from pcsr.errors import UserError
from pcsr.validation_messages import shown

Keys = tuple[str | int, ...]
"""Keys that lead to a value, such as ("model", "encoder", "channels")."""
MOST_BYTES = 1 << 18
"""Largest size of a recipe file. The recipes of pcsr have up to 3,000 bytes."""
MOST_VALUES = 10_000
"""Largest number of values of a recipe file, including those that aliases repeat."""
DEEPEST = 32
"""Largest depth of nested mappings and lists."""
MOST_DIGITS = 100
"""Largest number of digits of a whole number. The limits of all options are far lower."""
MOST_LISTED = 100
"""Largest number of mistakes that a message lists; further ones are counted."""


class Location(NamedTuple):
    """Location in a file, with line and column from 1, or a command-line option, with line and column 0."""

    origin: str
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        return f"{self.origin}:{self.line}:{self.column}" if self.line else self.origin


class Mistake(NamedTuple):
    """Mistake in a recipe, with its location and the remedy."""

    location: Location
    text: str

    def __str__(self) -> str:
        return f"{self.location}: {self.text}"


class RecipeError(UserError):
    """All mistakes of a recipe, one on each line, in the order of the file."""

    placed = True

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes = sorted(set(mistakes))
        more = len(self.mistakes) - MOST_LISTED
        lines = [*map(str, self.mistakes[:MOST_LISTED]), *([f"and {more} more mistakes"] if more > 0 else [])]
        super().__init__("\n".join(lines))


@dataclass
class Source:
    """Plain data of a recipe, with the location of each key and value."""

    data: dict[str, Any]
    values: dict[Keys, Location] = field(default_factory=dict)
    names: dict[Keys, Location] = field(default_factory=dict)
    """Locations of the keys, as opposed to `values`, which holds those of the values."""
    mistakes: list[Mistake] = field(default_factory=list)
    """Mistakes in the YAML itself. They are reported together with those that validation finds."""

    def copy(self) -> "Source":
        """Return a deep copy."""
        return Source(copy.deepcopy(self.data), dict(self.values), dict(self.names), list(self.mistakes))

    def location(self, keys: Keys, *, of_name: bool = False) -> Location:
        """Return the location of a value or key. If it is not in the file, return that of its section."""
        known = self.names if of_name else self.values
        if keys in known:
            return known[keys]
        while keys not in self.values:
            keys = keys[:-1]
        return self.values[keys]


def read(path: Path) -> Source:
    """Read a recipe file.

    Raises:
        UserError: there is no such file, it is too large, or it is not text.
        RecipeError: it is not YAML, or not a mapping.
    """
    try:
        # Reading a pipe without a writer would block, and a device has no end.
        if not stat.S_ISREG(os.stat(path).st_mode) and not path.is_dir():
            raise UserError(f"recipe {path} is no file but a pipe or a device: write the recipe into a file")
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise UserError(f"recipe {path} is larger than {MOST_BYTES} bytes, which no recipe is: name another file")
        text = content.decode()
    except OSError as error:
        raise UserError(f"recipe {path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise UserError(f"recipe {path} is not UTF-8 text: {error.reason} at byte {error.start}") from error
    return parse(text, str(path))


def parse(text: str, origin: str) -> Source:
    """Parse the text of a recipe; `origin` names it in messages.

    Raises:
        RecipeError: it is not YAML, not a mapping, or too large.
    """
    node = _composed(text, origin)
    if not isinstance(node, MappingNode):
        raise RecipeError([Mistake(Location(origin, 1, 1), "a recipe is a mapping: it starts with `name: …`")])
    source = Source({}, {(): Location(origin, 1, 1)})
    source.data = _Plain(source, origin).value(node, ())
    return source


def scalar(text: str, location: Location) -> Any:
    """Parse a value from the command line as YAML.

    Raises:
        RecipeError: it is not YAML, or too large.
    """
    source = Source({}, {(): location})
    try:
        node = _composed(text, location.origin)
        value = None if node is None else _Plain(source, location.origin).value(node, ())
    except RecipeError as error:
        raise RecipeError([Mistake(location, error.mistakes[0].text)]) from error
    if source.mistakes:
        raise RecipeError([Mistake(location, source.mistakes[0].text)])
    return value


def _composed(text: str, origin: str) -> Node | None:
    """Return the root node of a YAML document. An alias is the same node object as its anchor."""
    try:
        node: Node | None = YAML(typ="safe", pure=True).compose(text)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        location = Location(origin, mark.line + 1, mark.column + 1) if mark else Location(origin)
        what = error.problem or "not YAML"
        raise RecipeError([Mistake(location, f"{what}: correct the YAML there")]) from error
    except (YAMLError, ValueError) as error:  # a control character: no mark
        raise RecipeError([Mistake(Location(origin), f"not YAML: {str(error).splitlines()[0]}")]) from error
    except RecursionError as error:
        raise RecipeError([Mistake(Location(origin), TOO_DEEP)]) from error
    return node


TOO_DEEP = f"nested in more than {DEEPEST} levels: write it flatter"
YAML_TAG = "tag:yaml.org,2002:"


class _Plain:
    """Converts YAML's nodes to plain data; locations and mistakes go into `source`."""

    def __init__(self, source: Source, origin: str) -> None:
        self.source = source
        self.origin = origin
        self.values = 0

    def value(self, node: Node, keys: Keys, around: tuple[Node, ...] = ()) -> Any:
        """Return the plain value of the node at `keys`, inside the nodes `around`.

        Raises:
            RecipeError: there are too many values, or they are nested too deeply.
        """
        self.count()
        if node in around:
            return self.wrong(keys, "an alias that contains itself: write it out")
        if len(around) > DEEPEST:
            raise RecipeError([Mistake(self.source.location(keys), TOO_DEEP)])
        kind = _kind(node)
        if isinstance(node, MappingNode) and kind == "map":
            plain = {}
            for key, value, own in self.pairs(node, keys, around):
                here = (*keys, key)
                if own is not None:
                    self.source.names[here] = self.at(own)
                    self.source.values[here] = self.at(value)
                plain[key] = self.value(value, here, (*around, node))
            return plain
        if isinstance(node, SequenceNode) and kind == "seq":
            for index, item in enumerate(node.value[:MOST_VALUES]):
                self.source.values[(*keys, index)] = self.at(item)
            return [self.value(item, (*keys, i), (*around, node)) for i, item in enumerate(node.value)]
        if isinstance(node, ScalarNode):
            return self.scalar(node, kind, keys)
        return self.wrong(keys, f"recipes are plain data: remove the tag {_written(node)}")

    def count(self) -> None:
        """Count one more value.

        Raises:
            RecipeError: there are too many values. A few lines of nested aliases can expand beyond all memory.
        """
        self.values += 1
        if self.values > MOST_VALUES:
            text = f"more than {MOST_VALUES} values, including those that aliases repeat: shorten it"
            raise RecipeError([Mistake(Location(self.origin), text)])

    def pairs(
        self, node: MappingNode, keys: Keys, around: tuple[Node, ...]
    ) -> Iterator[tuple[str, Node, ScalarNode | None]]:
        """Yield the keys and values of a mapping with the keys' nodes. Merged keys (`<<`) come last, without nodes."""
        known = set()
        merged: list[Node] = []
        for key_node, value in node.value:
            if _kind(key_node) == "merge":
                merged += value.value if isinstance(value, SequenceNode) else [value]
                continue
            if not isinstance(key_node, ScalarNode):
                self.wrong(keys, "a key is a name: write lists and mappings behind the colon")
                continue
            key = str(self.scalar(key_node, _kind(key_node), keys))
            if key in known:
                text = f"{shown(key)} is written twice: remove one of the two"
                self.source.mistakes.append(Mistake(self.at(key_node), text))
                continue
            known.add(key)
            yield key, value, key_node
        for one in merged:
            if not isinstance(one, MappingNode):
                self.wrong(keys, "`<<` merges mappings in: write an alias of one behind it")
            elif one in (node, *around):
                self.wrong(keys, "`<<` merges a mapping into itself: write it out")
            else:
                self.count()
                for key, value, _ in self.pairs(one, keys, (*around, node)):
                    if key not in known:
                        known.add(key)
                        yield key, value, None

    def scalar(self, node: ScalarNode, kind: str, keys: Keys) -> Any:
        """Return the value of a scalar node."""
        text = str(node.value)
        if kind == "str":
            return text
        if kind == "null":
            return None
        if kind == "timestamp":
            return self.wrong(keys, "a date is not plain data: put it in quotes if text is meant")
        try:
            if kind == "bool":
                return {"true": True, "false": False}[text.lower()]
            if kind == "int":
                if len(text) > MOST_DIGITS:
                    return self.wrong(keys, f"a whole number has at most {MOST_DIGITS} digits, got {len(text)}")
                return int(text.replace("_", ""), 0 if text.lstrip("+-")[:2] in ("0x", "0o", "0b") else 10)
            if kind == "float":
                return float(text.replace("_", "").lower().replace(".inf", "inf").replace(".nan", "nan"))
        except (KeyError, ValueError):
            return self.wrong(keys, f"{shown(text)} is no {kind}: remove the tag, or write one")
        return self.wrong(keys, f"recipes are plain data: remove the tag {_written(node)}")

    def at(self, node: Node) -> Location:
        """Return the location of a node."""
        return Location(self.origin, node.start_mark.line + 1, node.start_mark.column + 1)

    def wrong(self, keys: Keys, text: str) -> None:
        """Record a mistake of the value at `keys`, whose value is then None."""
        self.source.mistakes.append(Mistake(self.source.location(keys), text))


def _kind(node: Node) -> str:
    """Return the kind of a node, such as "map", "seq" or "int", or a tag that YAML does not define."""
    return str(node.tag).removeprefix(YAML_TAG)


def _written(node: Node) -> str:
    """Return the tag of a node in short form, with `!!` for YAML's namespace."""
    return shown(str(node.tag).replace(YAML_TAG, "!!", 1)).strip("'")
