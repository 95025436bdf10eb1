"""Checks of shape sources: names, objects and digests."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from pcsr.contracts import SPLITS, ShapeItem, ShapeSource
from pcsr.errors import UserError
from pcsr.testing.subject import GIVE, Subject, pickled

TRIED = 3
"""Number of objects of each split that are loaded."""


def names(subject: Subject) -> None:
    """The names of a split are strings in a fixed order. Names are unique among all splits."""
    source, other = subject.built(), subject.built()
    found = _names(subject, source)
    if _names(subject, other) != found or _names(subject, source) != found:
        raise subject.failure(
            "its names are others, or in another order, when asked again", "a fixed order", "sort them"
        )
    everything = [name for split in found.values() for name in split]
    if not everything:
        raise subject.failure(
            "none of its splits has an object",
            "some object",
            f"give the suite options with which it has: {GIVE}",
        )
    if not all(isinstance(name, str) and name for name in everything):
        raise subject.failure("some of its names are no text, or empty", "texts", "make them str")
    twice = [name for name, times in Counter(everything).items() if times > 1]
    if twice:
        raise subject.failure(
            f"{len(twice)} names come twice, such as {twice[0]!r}",
            "that a name is one object's, whatever its split",
            "put the split or the folder into the name",
        )


def items(subject: Subject) -> None:
    """Objects can be loaded repeatedly with the same result, have the requested name, and have a surface."""
    source = subject.built()
    loaded = 0
    for name in _tried(subject, source):
        try:
            item, again = source.item(name), subject.built().item(name)
        except UserError as error:
            if name not in str(error):
                raise subject.failure(
                    f"it refuses an object with '{error}'",
                    "that the message says which object",
                    f"name '{name}' in the message",
                ) from error
            continue
        loaded += 1
        if not isinstance(item, ShapeItem) or item.name != name or not isinstance(item.group, str) or not item.group:
            raise subject.failure(
                f"for '{name}' it gives {item!r:.200}",
                "a ShapeItem of that name, with a group",
                "return pcsr.ShapeItem(name, group, mesh)",
            )
        vertices, faces = np.asarray(item.mesh.vertices), np.asarray(item.mesh.faces)
        if not len(faces) or not np.isfinite(vertices).all() or not item.mesh.area > 0:
            raise subject.failure(
                f"'{name}' has {len(faces)} faces, of an area of {item.mesh.area:g}",
                "a surface of finite coordinates",
                "raise a UserError for objects that cannot be used",
            )
        if not np.array_equal(vertices, again.mesh.vertices) or not np.array_equal(faces, again.mesh.faces):
            raise subject.failure(
                f"'{name}' is another object when asked again", "the same one", "draw from a seed that the name decides"
            )
    if not loaded:
        raise subject.failure(
            "it refuses all objects that were tried",
            "some that load",
            f"give the suite options: {GIVE}",
        )


def picklable(subject: Subject) -> None:
    """A pickled copy has the same names."""
    source = subject.built()
    copy = pickled(source)
    if _names(subject, copy) != _names(subject, source):
        raise subject.failure("a pickled copy has other names", "the same", "keep what decides them in attributes")


def digests(subject: Subject) -> None:
    """The digest of an object is a string, the same from every instance."""
    source, other = subject.built(), subject.built()
    for name in _tried(subject, source):
        digest, again = source.digest(name), other.digest(name)
        if not isinstance(digest, str) or digest != again:
            raise subject.failure(
                f"its digest of '{name}' is {digest!r}, then {again!r}",
                "one text, wherever the files lie",
                "let it depend on contents alone",
            )


def _names(subject: Subject, source: ShapeSource | Any) -> dict[str, list[Any]]:
    """Names by split, without splits that are refused."""
    found = {}
    for split in SPLITS:
        try:
            given = source.names(split)
        except UserError:
            continue
        if isinstance(given, str) or not isinstance(given, Sequence):
            raise subject.failure(
                f"its names of '{split}' are a {type(given).__name__}", "a sequence of texts", "return a list"
            )
        found[split] = list(given)
    return found


def _tried(subject: Subject, source: Any) -> list[str]:
    return [name for split in _names(subject, source).values() for name in split[:TRIED]]
