"""Merging of recipes: mappings key by key, parts with their options; each value keeps its location in its file."""

import copy
from typing import Any

from pcsr.recipe.old_names import modernize
from pcsr.recipe.part_keys import CHOICES, PART_LISTS, PARTS, owner_of
from pcsr.recipe.schema import DEFAULTS
from pcsr.recipe.source import DEEPEST, Keys, Location, Mistake, Source
from pcsr.validation_messages import shown


def normalize(source: Source, origin: str | None = None) -> Source:
    """Bring a recipe, in place, into the form that `merge` needs: `{use: name}` for each part, no names of 0.1."""
    for keys in (*PARTS, *CHOICES):
        section = owner_of(source.data, keys)
        if section is not None:
            _name(source, section, keys)
    for keys in PART_LISTS:
        parts = (owner_of(source.data, keys) or {}).get(str(keys[-1]))
        for index in range(len(parts) if isinstance(parts, list) else 0):
            _name(source, parts, (*keys, index))
    modernize(source, origin)
    return source


def _name(source: Source, owner: Any, keys: Keys) -> None:
    """Replace a bare name, the value at the last of `keys` in its owner, by `{use: name}`, in place."""
    value = owner.get(keys[-1]) if isinstance(owner, dict) else owner[keys[-1]]
    if isinstance(value, str):
        owner[keys[-1]] = {"use": value}
        source.values[(*keys, "use")] = source.location(keys)


def merge(base: Source, override: Source) -> Source:
    """Return one recipe overridden by another: mappings are merged key by key, all other values replaced.

    If both name the same part, its options are merged too. If they name different parts, the base's options are
    dropped.
    """
    merged = base.copy()
    override = override.copy()
    modernize(override, base=base.data)  # options beside no `use` are those of the base's part
    updated, replaced = _update(merged.data, override.data, ())
    for locations, new_locations in ((merged.values, override.values), (merged.names, override.names)):
        for known in [keys for keys in locations if _inside(keys, replaced)]:
            del locations[known]
        locations |= {
            keys: location for keys, location in new_locations.items() if keys in updated or _inside(keys, replaced)
        }
    merged.values[()] = override.values[()]
    merged.mistakes += override.mistakes
    return merged


def _update(base: dict[str, Any], override: dict[str, Any], keys: Keys) -> tuple[set[Keys], set[Keys]]:
    """Merge `override` into `base`, both at `keys`, in place.

    Returns:
        The keys of the mappings that were merged, and those of the values that were replaced.
    """
    updated: set[Keys] = set()
    replaced: set[Keys] = set()
    for key, value in override.items():
        inner = (*keys, key)
        old = base.get(key)
        if any(inner[:depth] in PARTS for depth in (2, 3) if depth < len(inner)) and {type(old), type(value)} == {
            str,
            dict,
        }:
            old, value = _mapping(old), _mapping(value)
            base[key] = old
        if isinstance(old, dict) and isinstance(value, dict) and not _other_part(inner, old, value):
            updated.add(inner)
            if inner == ("model", "graft") and value.get("network", old.get("network")) != old.get("network"):
                for of_network in ("options", "weights"):  # the old network's
                    old.pop(of_network, None)
                    replaced.add((*inner, of_network))
            inner_updated, inner_replaced = _update(old, value, inner)
            updated |= inner_updated
            replaced |= inner_replaced
        else:
            replaced.add(inner)
            base[key] = copy.deepcopy(value)
    return updated, replaced


def _mapping(value: Any) -> dict[str, Any]:
    """Return the mapping `{use: name}` of a choice that is written as its bare name."""
    return {"use": value} if isinstance(value, str) else value


def _inside(keys: Keys, replaced: set[Keys]) -> bool:
    """Return whether a value, or one that contains it, was replaced."""
    return any(keys[:depth] in replaced for depth in range(1, len(keys) + 1))


def _other_part(keys: Keys, old: dict[str, Any], new: dict[str, Any]) -> bool:
    """Return whether two mappings name different parts, optimizers or the like, or are different kinds of model."""
    if keys == ("model",):
        return "graft" in new if "graft" not in old else "encoder" in new and "graft" not in new
    return (keys in PARTS or keys in CHOICES) and "use" in new and new["use"] != old.get("use")


def assign(source: Source, keys: Keys, value: Any, location: Location, name: Location | None = None) -> None:
    """Set one value of a recipe, in place, as if a recipe with this value alone were merged over it.

    Args:
        source: recipe to change.
        keys: keys of the value.
        value: new value.
        location: location of the value in its file.
        name: location of the key; that of the value by default.
    """
    if keys[0] == "model" and len(keys) > 1:  # a recipe without a model has the default one, which is changed here
        source.data.setdefault("model", copy.deepcopy(DEFAULTS["model"]))
    data: Any = value
    over = Source({}, {(): source.values[()], keys: location}, {keys: name or location})
    for depth in range(len(keys), 0, -1):
        data = {keys[depth - 1]: data}
        if keys[:depth] not in source.values:
            over.values[keys[:depth]] = location
            over.names[keys[:depth]] = name or location
    over.data = data
    merged = merge(source, normalize(over, str(name or location)))
    source.data, source.values, source.names = merged.data, merged.values, merged.names


def assign_dotted(source: Source, dotted: str, value: Any, location: Location, name: Location | None = None) -> None:
    """Do as `assign`, for a dotted key; a key of too many dots is added to the mistakes."""
    keys = tuple(dotted.split("."))
    if len(keys) > DEEPEST:
        text = f"{shown(dotted)} nests {len(keys)} keys, and a recipe at most {DEEPEST}: shorten it"
        source.mistakes.append(Mistake(name or location, text))
    else:
        assign(source, keys, value, location, name)
