"""Renamed keys and parts of recipes: names of pcsr 0.1 are still read, and fingerprints are computed with them.

Recipe files, the cards of weights and the manifests of data sets are read through `modernize`. Fingerprints are
computed from `as_in_0_1`, so that existing run folders, weights and data sets stay valid.
"""

import copy
import warnings
from typing import Any

from pcsr.errors import PcsrWarning
from pcsr.plugins import renamed
from pcsr.recipe.part_keys import PARTS, owner_of
from pcsr.recipe.source import Keys, Location, Source
from pcsr.validation_messages import shortened

KEYS: dict[Keys, str] = {
    ("train", "rate"): "learning_rate",
    ("evaluate", "beside"): "baselines",
    ("patches", "cover"): "overlap",
}
"""Renamed keys of recipes: old keys to the new last key."""
OPTIONS: dict[tuple[str, str], dict[str, Keys]] = {
    ("fusion", "edge-conv"): {"heard": ("points_per_touch",)},
    ("touch", "digit"): {
        **{key: ("sensor", key) for key in ("projection", "width", "height", "pixels", "fov", "distance", "dome")},
        **{key: ("sensor", key) for key in ("housing", "protrusion", "senses", "reach")},
        **{key: ("policy", key) for key in ("spacing", "tries")},
        **{key: ("noise", key) for key in ("blur", "drift", "drift_length", "depth_noise", "quantum")},
        **{key: ("noise", key) for key in ("position_noise", "rotation_noise")},
    },
}
"""Renamed options of parts: kind and new name of the part to old options, each with the keys of the new option."""


REMOVED: dict[tuple[str, str], dict[str, Any]] = {
    ("upsampler", "branches"): {"chained": False},
    ("upsampler", "progressive"): {"step": 2},
    ("objective", "pu-gan"): {"fidelity": "emd"},
    ("objective", "pu-net"): {"fidelity": "emd"},
}
"""Options that parts had in 0.1, with the value that they had by default and now always have."""
ADDED: dict[tuple[str, str], dict[Keys, Any]] = {
    ("encoder", "unet"): {("norm",): "none", ("negative_slope",): 0.0},
    ("fusion", "iterative"): {("pairing",): "hilbert", ("offsets",): False, ("negative_slope",): 0.0},
    ("backbone", "pu-transformer"): {("negative_slope",): 0.0},
    ("fusion", "edge-conv"): {("keeps_touched_points",): True},
    ("touch", "digit"): {("noise", "shared_position_noise"): 0.0, ("noise", "shared_rotation_noise"): 0.0},
}
"""Options that parts did not have in 0.1, with the value that changes nothing."""
ADDED_KEYS: dict[Keys, Any] = {
    ("data", "registration"): None,
    ("train", "schedule"): "steps",
    ("train", "final_learning_rate"): 0.0,
    ("train", "warmup"): 0.0,
    ("train", "clip_norm"): None,
    ("train", "average"): None,
    ("train", "validate_every"): None,
    ("train", "patience"): None,
    ("train", "snapshots"): [],
    ("train", "start"): None,
}
"""Keys that recipes did not have in 0.1, with the value that changes nothing."""


def modernize(source: Source, origin: str | None = None, base: dict[str, Any] | None = None) -> None:
    """Replace the names of 0.1 in a recipe, in place.

    Args:
        source: recipe to change.
        origin: name of the recipe in the warning; its file by default.
        base: data of the recipe that it is merged over; a part without `use` is the base's.

    Warns:
        PcsrWarning: the recipe uses names of 0.1; one warning lists all of them with the new names.
    """
    notes: list[str] = []
    for keys, new in KEYS.items():
        if _move(source, keys, (keys[0], new)):
            notes.append(f"{_dotted(keys)} is now {keys[0]}.{new}")
    for keys, kind in PARTS.items():
        notes += _modernize_part(source, keys, kind, base or {})
    matrix = source.data.get("matrix")
    notes += _modernize_dotted(source, ("matrix",), matrix)
    groups = matrix.items() if isinstance(matrix, dict) else ()
    tables = [(("matrix", axis), rows) for axis, rows in groups] + [(("recipes",), source.data.get("recipes"))]
    for keys, rows in tables:
        for number, row in enumerate(rows if isinstance(rows, list) else ()):
            notes += _modernize_dotted(source, (*keys, number), row)
    if notes:
        origin = origin or source.values[()].origin
        text = f"{origin} uses names of pcsr 0.1, which are still read: {'; '.join(dict.fromkeys(notes))}"
        warnings.warn(shortened(text, 1000), PcsrWarning, stacklevel=2)


def modern_key(dotted: str) -> str:
    """Return the new name of a dotted key, such as `train.rate`; the key itself if it was not renamed."""
    keys = tuple(dotted.split("."))
    return ".".join((*map(str, keys[:1]), KEYS[keys])) if keys in KEYS else dotted


def as_in_0_1(plain: dict[str, Any]) -> dict[str, Any]:
    """Return a copy of a resolved recipe with the names of 0.1."""
    old = copy.deepcopy(plain)
    for keys, new in KEYS.items():
        section = old.get(str(keys[0]))
        if isinstance(section, dict) and new in section:
            section[str(keys[1])] = section.pop(new)
    for keys, kind in PARTS.items():
        section = owner_of(old, keys)
        if section is not None and isinstance(section.get(str(keys[-1])), dict):
            section[str(keys[-1])] = part_as_in_0_1(kind, section[str(keys[-1])])
    for (section_name, key), unchanged in ADDED_KEYS.items():
        section = old.get(str(section_name))
        if isinstance(section, dict) and key in section and section[key] == unchanged:
            del section[key]
    train = old.get("train")
    if isinstance(train, dict):
        train.pop("loggers", None)  # no value of it changes anything
        optimizer = train.get("optimizer")
        if isinstance(optimizer, dict) and optimizer.keys() == {"use"}:
            train["optimizer"] = optimizer["use"]
    return old


def part_as_in_0_1(kind: str, part: dict[str, Any]) -> dict[str, Any]:
    """Return a copy of a part's mapping `{use: name, …}` with the names of 0.1."""
    old = copy.deepcopy(part)
    old |= REMOVED.get((kind, old["use"]), {})
    for keys, unchanged in ADDED.get((kind, old["use"]), {}).items():
        owner = _owner(old, keys)
        if owner.get(keys[-1]) == unchanged:
            del owner[keys[-1]]
    moved = OPTIONS.get((kind, old["use"]), {})
    for option, keys in moved.items():
        owner = _owner(old, keys)
        if keys[-1] in owner:
            old[option] = owner.pop(keys[-1])
    for group in {str(keys[0]) for keys in moved.values() if len(keys) > 1}:
        left = old.get(group)
        if left == {}:
            del old[group]
        elif isinstance(left, dict) and left.keys() == {"use"}:
            old[group] = left["use"]
    names = {new: name for (of_kind, name), new in renamed.PARTS.items() if of_kind == kind}
    return {**old, "use": names.get(old["use"], old["use"])}


def _owner(part: dict[str, Any], keys: Keys) -> dict[Any, Any]:
    """Return the mapping that holds the last of `keys`; an empty one if there is none."""
    owner: Any = part
    for key in keys[:-1]:
        owner = owner.get(key) if isinstance(owner, dict) else None
    return owner if isinstance(owner, dict) else {}


def modern_part(kind: str, part: dict[str, Any]) -> dict[str, Any]:
    """Return a copy of a part's mapping `{use: name, …}` with today's names."""
    section, key = next(keys for keys, of in PARTS.items() if of == kind and len(keys) == 2)
    source = Source({str(section): {key: copy.deepcopy(part)}}, {(): Location(f"the {kind}")})
    _modernize_part(source, (section, key), kind, {})
    modern: dict[str, Any] = source.data[str(section)][key]
    return modern


def _modernize_part(source: Source, keys: Keys, kind: str, base: dict[str, Any]) -> list[str]:
    part = (owner_of(source.data, keys) or {}).get(str(keys[-1]))
    if not isinstance(part, dict):
        return []
    below = (owner_of(base, keys) or {}).get(str(keys[-1]))
    use = part.get("use", below.get("use") if isinstance(below, dict) else None)
    if not isinstance(use, str):
        return []
    notes = []
    new = renamed.PARTS.get((kind, use)) if "use" in part else None
    if new is not None:
        notes.append(f"{kind} '{part['use']}' is now '{new}'")
        part["use"] = use = new
    for option, default in REMOVED.get((kind, use), {}).items():
        if option in part and part[option] == default:
            del part[option]
    name = f"{kind} '{use}'"
    grouped: dict[str, list[str]] = {}
    for option, inner in OPTIONS.get((kind, use), {}).items():
        if not _move(source, (*keys, option), (*keys, *inner)):
            continue
        if inner[-1] == option:
            grouped.setdefault(_dotted(inner[:-1]), []).append(option)
        else:
            notes.append(f"option '{option}' of {name} is now '{_dotted(inner)}'")
    notes += [f"of {name} {', '.join(some)} stand under '{group}' now" for group, some in grouped.items()]
    return notes


def _modernize_dotted(source: Source, keys: Keys, mapping: Any) -> list[str]:
    """Rename the dotted keys of the mapping at `keys`, in place, and return a note for each."""
    if not isinstance(mapping, dict):
        return []
    old = [key for key in mapping if isinstance(key, str) and modern_key(key) != key]
    moved = [key for key in old if _move(source, (*keys, key), (*keys, modern_key(key)))]
    return [f"{key} is now {modern_key(key)}" for key in moved]


def _move(source: Source, old: Keys, new: Keys) -> bool:
    """Move a value and its location in the file from one key to another, and return whether it was moved.

    If the new key exists too, nothing is moved, and the old key is later reported as unknown.
    """
    owner: Any = source.data
    for key in old[:-1]:
        owner = owner.get(key) if isinstance(owner, dict) else owner[int(key)] if isinstance(owner, list) else None
    if not isinstance(owner, dict) or old[-1] not in owner:
        return False
    target: Any = owner
    for key in new[len(old) - 1 : -1]:
        if isinstance(target, dict) and isinstance(target.get(key), str):  # a bare name beside its options
            target[key] = {"use": target[key]}
        target = target.setdefault(key, {}) if isinstance(target, dict) else None
    if not isinstance(target, dict) or new[-1] in target:
        return False
    if target is owner:  # keep the order, since that of a matrix determines the names of its runs
        items = [(new[-1] if key == old[-1] else key, value) for key, value in owner.items()]
        owner.clear()
        owner.update(items)
    else:
        target[new[-1]] = owner.pop(old[-1])
    for known in (source.values, source.names):
        for keys in [keys for keys in known if keys[: len(old)] == old]:
            known[(*new, *keys[len(old) :])] = known.pop(keys)
    return True


def _dotted(keys: Keys) -> str:
    return ".".join(map(str, keys))
