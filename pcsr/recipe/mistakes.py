"""Pydantic's errors as mistakes in a recipe: each with the location of its value and a remedy."""

from collections.abc import Callable
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from pcsr.errors import did_you_mean
from pcsr.recipe.old_names import KEYS
from pcsr.recipe.schema import GRAFT_TAG, PARTS_TAG, Model, Recipe
from pcsr.recipe.source import Keys, Location, Mistake
from pcsr.validation_messages import explained, shown

Locate = Callable[[Keys, bool], Location]
"""Function from the keys of a value to its location in the file or, if the flag is true, to that of its last key."""

TAGS = (PARTS_TAG, GRAFT_TAG)
"""Items of the locations of pydantic's errors that are no keys."""


def mistakes_of(
    error: ValidationError, data: Any, model: type[BaseModel], head: tuple[str, ...], locate: Locate
) -> list[Mistake]:
    """Convert pydantic's errors to mistakes, one for each value: errors of a union's branches are merged.

    Args:
        error: what validation raised.
        data: what was validated.
        model: of the data.
        head: words before the keys in messages, such as the name of a part.
        locate: locations of the keys in the file.
    """
    by_keys: dict[Keys, list[Any]] = {}
    for one in error.errors():
        missing = one["type"] in ("missing", "extra_forbidden")
        keys = tuple(key for key in one["loc"] if key not in TAGS) if missing else _existing(one["loc"], data)
        by_keys.setdefault(keys, []).append(one)
    # An error within a value says more than one of the whole value, which is of another branch of the union.
    outer = {keys[:depth] for keys in by_keys for depth in range(len(keys))}
    return [_mistake(keys, errors, model, head, locate) for keys, errors in by_keys.items() if keys not in outer]


def _mistake(keys: Keys, errors: list[Any], model: type[BaseModel], head: tuple[str, ...], locate: Locate) -> Mistake:
    kind = errors[0]["type"]
    path = ".".join((*head, *map(_key, keys)))
    if kind == "extra_forbidden":
        owner = " ".join([*head, *map(_key, keys[:-1])]) or "a recipe"
        if not head and str(keys[-1]) in ("extends", "matrix", "recipes"):
            return Mistake(locate(keys, True), f"'{keys[-1]}' is a key of the file: write it at the top level")
        if not head and keys in KEYS:
            new = f"{keys[0]}.{KEYS[keys]}"
            return Mistake(locate(keys, True), f"{path} is the old name of {new}, which is given too: remove it")
        if not head and keys[:-1] == ("model",) and keys[-1] in Model.model_fields:
            return Mistake(locate(keys, True), f"a model has either graft or {keys[-1]}: remove one of the two")
        remedy = did_you_mean(str(keys[-1]), _fields(model, keys[:-1]))
        return Mistake(locate(keys, True), f"{owner} takes no '{_key(keys[-1])}': {remedy}")
    if kind == "missing":
        return Mistake(locate(keys[:-1], False), f"{path} is missing: add it")
    if kind == "model_type":
        got = shown(errors[0]["input"])
        return Mistake(locate(keys, False), f"{path} is a section: write its keys under it, got {got}")
    return Mistake(locate(keys, False), f"{path}: {explained(errors)}")


def _key(key: int | str) -> str:
    """Return a key for a message, shortened if it is long."""
    return shown(key)[1:-1] if isinstance(key, str) else str(key)


def _existing(loc: tuple[int | str, ...], data: Any) -> Keys:
    """Return pydantic's location of an error without the names of union branches, which are not keys of the data."""
    keys: list[int | str] = []
    for key in loc:
        try:
            data = data[key]
        except (LookupError, TypeError):
            continue
        keys.append(key)
    return tuple(keys)


def _fields(model: type[BaseModel], keys: Keys) -> list[str]:
    models: list[type[BaseModel]] = [model]
    for key in keys:
        annotations = [one.model_fields[str(key)].annotation for one in models if str(key) in one.model_fields]
        # Of `Section | None`, the section; of a model, both of its kinds.
        kinds = [getattr(kind, "__origin__", kind) for one in annotations for kind in get_args(one) or (one,)]
        models = [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)]
    extra = ["extends", "matrix", "recipes"] if models == [Recipe] else []
    return [*(field for one in models for field in one.model_fields), *extra]
