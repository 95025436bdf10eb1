"""From files and options to the data of each run: `extends`, `--set`, `matrix`."""

import copy
import itertools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pcsr.errors import UserError
from pcsr.recipe.source import Keys, Mistake, Place, RecipeError, Source, read, scalar

PARTS: frozenset[Keys] = frozenset(
    {
        ("data", "shapes"),
        ("data", "touch"),
        ("model", "encoder"),
        ("model", "touch_encoder"),
        ("model", "fusion"),
        ("model", "backbone"),
        ("model", "upsampler"),
        ("train", "objective"),
    }
)
"""Where a bare name is short for `{use: name}`."""


def compose(path: Path, overrides: Sequence[str] = ()) -> list[Source]:
    """Every run that a recipe file describes; one, unless it has a matrix.

    Raises:
        RecipeError: parents that go in a circle, a matrix that is not one.
        UserError: a file that can't be read, a `--set` that is not `key=value`.
    """
    source = _with_parents(path, ())
    for override in overrides:
        _set(source, override)
    return list(_expand(source))


def _with_parents(path: Path, children: tuple[Path, ...]) -> Source:
    source = read(path)
    if "extends" not in source.data:
        return source
    parent = source.data.pop("extends")
    place = source.values[("extends",)]
    if not isinstance(parent, str):
        raise RecipeError([Mistake(place, f"extends names one recipe file, got {parent!r}")])
    target = path.parent / parent
    line = (*children, path.resolve())
    if target.resolve() in line:
        raise RecipeError([Mistake(place, f"'{parent}' extends this recipe in turn: break the circle")])
    if not target.is_file():
        raise RecipeError([Mistake(place, f"there is no recipe {target}: extends is relative to this file")])
    return merge(_with_parents(target, line), source)


def merge(under: Source, over: Source) -> Source:
    """Lay one recipe over another: mappings key by key, everything else replaced whole."""
    merged = Source(copy.deepcopy(under.data), dict(under.values), dict(under.names))
    _merge_into(merged, over, (), merged.data, over.data)
    merged.values[()] = over.values[()]
    return merged


def _merge_into(target: Source, over: Source, keys: Keys, below: dict[str, Any], above: dict[str, Any]) -> None:
    for key, value in above.items():
        here = (*keys, key)
        old = below.get(key)
        if isinstance(old, dict) and isinstance(value, dict) and not _other_part(here, old, value):
            _merge_into(target, over, here, old, value)
            _copy_places(target, over, here, whole=False)
        elif here in PARTS and isinstance(old, dict) and old.get("use") == value:
            pass  # the same part by its bare name: its options stay
        else:
            _forget(target, here)
            below[key] = copy.deepcopy(value)
            _copy_places(target, over, here, whole=True)


def _other_part(keys: Keys, old: dict[str, Any], new: dict[str, Any]) -> bool:
    """The options of one part mean nothing to another."""
    return keys in PARTS and "use" in new and new["use"] != old.get("use")


def _forget(source: Source, keys: Keys) -> None:
    for places in (source.values, source.names):
        for known in [k for k in places if k[: len(keys)] == keys]:
            del places[known]


def _copy_places(target: Source, over: Source, keys: Keys, *, whole: bool) -> None:
    for mine, theirs in ((target.values, over.values), (target.names, over.names)):
        for known, place in theirs.items():
            if known == keys or (whole and known[: len(keys)] == keys):
                mine[known] = place


def _set(source: Source, override: str) -> None:
    """Apply `dotted.key=value`."""
    dotted, equals, text = override.partition("=")
    if not equals or not dotted:
        raise UserError(f"--set {override}: write --set dotted.key=value, for example --set train.epochs=5")
    assign(source, tuple(dotted.split(".")), scalar(text), Place(f"--set {override}"))


def assign(source: Source, keys: Keys, value: Any, place: Place) -> None:
    """Put one value into the data, as if a file with nothing else were laid over it."""
    data: Any = value
    over = Source({}, {(): source.values[()]})
    for i in range(len(keys), 0, -1):
        over.values[keys[:i]] = over.names[keys[:i]] = place
        # An option of a part that is given by its bare name.
        if keys[: i - 1] in PARTS and isinstance(old := _get(source.data, keys[: i - 1]), str) and keys[i - 1] != "use":
            data = {"use": old, keys[i - 1]: data}
        else:
            data = {keys[i - 1]: data}
    over.data = data
    merged = merge(source, over)
    source.data, source.values, source.names = merged.data, merged.values, merged.names


def _get(data: Any, keys: Keys) -> Any:
    for key in keys:
        data = data.get(key) if isinstance(data, dict) else None
    return data


def _expand(source: Source) -> Iterator[Source]:
    """A matrix to its product: each row one recipe, named after its values."""
    if "matrix" not in source.data:
        yield source
        return
    place = source.place(("matrix",))
    matrix = source.data.pop("matrix")
    if not isinstance(matrix, dict) or not all(isinstance(v, list) and v for v in matrix.values()):
        raise RecipeError([Mistake(place, "a matrix maps dotted keys to lists of values: `model.fusion: [none, concat]`")])
    for row in itertools.product(*(range(len(values)) for values in matrix.values())):
        run = Source(copy.deepcopy(source.data), dict(source.values), dict(source.names))
        label = []
        for (dotted, values), index in zip(matrix.items(), row, strict=True):
            here = source.place(("matrix", dotted, index))
            value = values[index]
            # A mapping varies several keys together: {model.encoder: mlp, model.fusion: none}, under a free name.
            changes = value if isinstance(value, dict) and all("." in key for key in value) else {dotted: value}
            for key, one in changes.items():
                assign(run, tuple(key.split(".")), one, here)
            label.append(_label(dotted, value, changes))
        run.data["name"] = "-".join([str(source.data.get("name", "run")), *label])
        yield run


def _label(dotted: str, value: Any, changes: dict[str, Any]) -> str:
    text = f"{dotted.rpartition('.')[2]}.{_short(value)}" if dotted in changes else ".".join(map(_short, changes.values()))
    return re.sub(r"[^a-z0-9.]+", ".", text.lower()).strip(".")


def _short(value: Any) -> str:
    return str(value.get("use", "")) if isinstance(value, dict) else str(value)
