"""One recipe over another: mappings key by key, parts with their options, each value with its place."""

import copy
from typing import Any

from pcsr.mistakes import shown
from pcsr.recipe.old_names import modernize
from pcsr.recipe.part_keys import PARTS
from pcsr.recipe.schema import DEFAULTS
from pcsr.recipe.source import DEEPEST, Keys, Mistake, Place, Source


def normalize(source: Source) -> Source:
    """Bring a recipe into the form in which recipes are merged, in place: `{use: name}` for a part, today's names."""
    for keys in PARTS:
        section = source.data.get(str(keys[0]))
        if isinstance(section, dict) and isinstance(section.get(keys[1]), str):
            section[keys[1]] = {"use": section[keys[1]]}
            source.values[(*keys, "use")] = source.place(keys)
    modernize(source)
    return source


def merge(under: Source, over: Source) -> Source:
    """Lay one recipe over another: mappings key by key, everything else replaced whole.

    The options of a part stay if the same part is named again, and go with it if another is.
    """
    merged = under.copy()
    kept, replaced = _merge_into((), merged.data, over.data)
    for mine, theirs in ((merged.values, over.values), (merged.names, over.names)):
        for known in [keys for keys in mine if _inside(keys, replaced)]:
            del mine[known]
        mine |= {keys: place for keys, place in theirs.items() if keys in kept or _inside(keys, replaced)}
    merged.values[()] = over.values[()]
    merged.mistakes += over.mistakes
    return merged


def _merge_into(keys: Keys, below: dict[str, Any], above: dict[str, Any]) -> tuple[set[Keys], set[Keys]]:
    """Lay `above` over `below`: which values were laid over key by key, and which were replaced whole."""
    kept: set[Keys] = set()
    replaced: set[Keys] = set()
    for key, value in above.items():
        here = (*keys, key)
        old = below.get(key)
        if here[:2] in PARTS and len(here) > 2 and {type(old), type(value)} == {str, dict}:
            old, value = _mapping(old), _mapping(value)
            below[key] = old
        if isinstance(old, dict) and isinstance(value, dict) and not _other_part(here, old, value):
            kept.add(here)
            for all_of, inner in zip((kept, replaced), _merge_into(here, old, value), strict=True):
                all_of |= inner
        else:
            replaced.add(here)
            below[key] = copy.deepcopy(value)
    return kept, replaced


def _mapping(value: Any) -> dict[str, Any]:
    """A choice among a part's options: a bare name is short for `{use: name}`."""
    return {"use": value} if isinstance(value, str) else value


def _inside(keys: Keys, replaced: set[Keys]) -> bool:
    """Whether a value, or one around it, is among those that were replaced."""
    return any(keys[:depth] in replaced for depth in range(1, len(keys) + 1))


def _other_part(keys: Keys, old: dict[str, Any], new: dict[str, Any]) -> bool:
    """The options of one part, or of one choice inside of a part, mean nothing to another."""
    return keys[:2] in PARTS and "use" in new and new["use"] != old.get("use")


def assign(source: Source, keys: Keys, value: Any, place: Place, name: Place | None = None) -> None:
    """Put one value into the data, as if a file with nothing else were laid over it."""
    if keys[0] == "model" and len(keys) > 1:  # a change to the model that a recipe without one gets
        source.data.setdefault("model", copy.deepcopy(DEFAULTS["model"]))
    data: Any = value
    over = Source({}, {(): source.values[()], keys: place}, {keys: name or place})
    for depth in range(len(keys), 0, -1):
        data = {keys[depth - 1]: data}
        if keys[:depth] not in source.values:
            over.values[keys[:depth]] = place
            over.names[keys[:depth]] = name or place
    over.data = data
    merged = merge(source, normalize(over))
    source.data, source.values, source.names = merged.data, merged.values, merged.names


def assign_dotted(source: Source, dotted: str, value: Any, place: Place, name: Place | None = None) -> None:
    """As `assign`, for a key that a person wrote with dots; one of too many is a mistake."""
    keys = tuple(dotted.split("."))
    if len(keys) > DEEPEST:
        text = f"{shown(dotted)} has {len(keys)} keys in each other, and no recipe more than {DEEPEST}"
        source.mistakes.append(Mistake(name or place, text))
    else:
        assign(source, keys, value, place, name)
