"""Parts in the card of weights: their origin, whether they are installed, and whether their code has changed."""

import re
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from typing import Any

from pcsr.errors import UserError
from pcsr.plugins import renamed
from pcsr.plugins.networks import find_network
from pcsr.plugins.registry import FILE, FIRST_PARTY, Registry
from pcsr.recipe import MODEL, Recipe
from pcsr.recipe.part_keys import NETWORK, NETWORK_KEYS, PARTS, owner_of
from pcsr.recipe.schema import GraftedModel
from pcsr.recipe.source import Keys
from pcsr.run_files import PLUGINS
from pcsr.version import __version__
from pcsr.weights.fit import RETRAIN

PLAIN = {"kind": r"[a-z]+", "name": r"[\w.-]+", "owner": r"[\w. -]+", "version": r"[\w.+!-]+"}
"""Patterns of a part's fields in a card. Other values are ignored, since messages suggest commands with them."""
LONG = 100
"""Largest number of characters of a card's name that a message shows."""


def foreign_parts(recipe: Mapping[str, Any], registry: Registry) -> list[dict[str, str]]:
    """Return kind, name, owner and version of each third-party part of a resolved recipe.

    The owner of a part from a plugin file is the name of the file without its folder, and the version is "file".
    """
    parts = []
    for kind, name in _used(recipe):
        entry = registry.entries.get((kind, name))
        if entry is not None and entry.owner != FIRST_PARTY:
            parts.append({"kind": kind, "name": name, "owner": entry.brought_by, "version": entry.version})
    return parts


def _used(recipe: Mapping[str, Any], keys: Collection[Keys] = PARTS.keys()) -> list[tuple[str, str]]:
    """Return kind and name of each part that a recipe names under `keys`, without repetitions.

    Old names of renamed parts are replaced. The recipe need not be valid.
    """
    used = []
    for part_keys in (part for part in PARTS if part in keys):
        part = (owner_of(recipe, part_keys) or {}).get(str(part_keys[-1]))
        if isinstance(part, dict) and isinstance(part.get("use"), str):
            kind, name = PARTS[part_keys], part["use"]
            used.append((kind, str(renamed.PARTS.get((kind, name), name))))
    return list(dict.fromkeys(used))


def _parts(card: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return the third-party parts of a card whose fields match `PLAIN`."""
    parts = card.get("parts")
    return [
        part
        for part in (parts if isinstance(parts, list) else [])
        if isinstance(part, dict)
        and all(isinstance(part.get(key), str) and re.fullmatch(shape, part[key]) for key, shape in PLAIN.items())
    ]


def check_parts(path: Path, card: Mapping[str, Any], registry: Registry) -> None:
    """Check that all parts of the network in a card are installed.

    Raises:
        UserError: parts are missing. The message names them, and the plugins that register them.
    """
    known = {(part["kind"], part["name"]): part for part in _parts(card)}
    missing = [part for part in _used(card["recipe"], MODEL) if part not in registry.entries]
    needed = []
    for part in missing:
        owner = known.get(part, {}).get("owner", "")
        needed.append(_needed(*part, known.get(part), registry) + _copy(path, owner))
    network = (owner_of(card["recipe"], NETWORK_KEYS) or {}).get("network")
    if isinstance(network, str) and NETWORK.fullmatch(network):
        try:
            find_network(registry, network)
        except UserError as error:
            needed.append(str(error) + _copy(path, network.partition(":")[0]))
    if needed:
        raise UserError(f"the weights {path} need {'; and '.join(needed)}")


def _copy(path: Path, file: str) -> str:
    """Name the copy of a plugin file in the run folder of weights; empty if there is none."""
    copies = sorted(one for one in (path.parent / PLUGINS).rglob("*.py") if one.name == file)
    return f", of which the run has a copy, {copies[0]}" if copies else ""


def _needed(kind: str, name: str, part: Mapping[str, str] | None, registry: Registry) -> str:
    """Describe a missing part and the remedy."""
    if part is None:  # a card without this field, or a first-party part that was removed
        name = name if re.fullmatch(PLAIN["name"], name[:LONG]) else ascii(name[:LONG])[1:-1]
        return f"{kind} '{name[:LONG]}', which no plugin here brings: install the one that does, or hand its file in"
    owner, version = part["owner"], part["version"]
    if version == FILE:
        return f"{kind} '{name}' of the plugin file {owner}: hand in that file with --plugin (in Python: plugins=[…])"
    if any(failure.owner == owner for failure in registry.failures):
        return f"{kind} '{name}' of {owner} {version}, which failed to load: see `pcsr plugins --why {owner}`"
    installed = {entry.owner: entry.version for entry in registry}.get(owner)
    here = "" if installed is None else f", and {owner} {installed} is installed"
    return f"{kind} '{name}' of {owner} {version}{here}: pip install {owner}=={version}"


def mismatch_remedy(card: Mapping[str, Any], registry: Registry) -> str:
    """Describe the versions at training, those installed, and the remedy, for weights that do not fit."""
    before, here, install, files = [], [], [], []
    for part in _parts(card):
        entry = registry.entries.get((part["kind"], part["name"]))
        if entry is None or (entry.brought_by, entry.version) == (part["owner"], part["version"]):
            continue
        before.append(f"{part['kind']} '{part['name']}' of {part['owner']} {part['version']}")
        here.append(f"{entry.brought_by} {entry.version}")
        if part["version"] == FILE:
            files.append(part["owner"])
        else:
            install.append(f"{part['owner']}=={part['version']}")
    version = card.get("version")
    if isinstance(version, str) and re.fullmatch(PLAIN["version"], version) and version != __version__:
        before.append(f"pcsr {version}")
        here.append(f"pcsr {__version__}" if here else __version__)
        install.append(f"pcsr=={version}")
    if not before:
        return RETRAIN
    remedies = [f"pip install {' '.join(dict.fromkeys(install))}"] if install else []
    remedies += [f"hand in {file} with --plugin" for file in dict.fromkeys(files)]
    return (
        f"They were made by {' and '.join(before)}, this is {' and '.join(here)}: {', '.join(remedies)}, or train again"
    )


def changed(recipe: Recipe, written: Any, registry: Registry, keys: Iterable[Keys] = PARTS.keys()) -> dict[str, str]:
    """Return the parts whose code has changed since training.

    Args:
        recipe: recipe with the hashes of the current code.
        written: resolved recipe of a card, with the hashes of the code at training.
        registry: installed parts.
        keys: sections and keys of the parts to compare.

    Returns:
        Dotted keys of the recipe to descriptions of parts, such as "fusion 'x' (mine.py)".
    """
    then = written.get("code") if isinstance(written, dict) else None
    then = then if isinstance(then, dict) else {}
    found = {}
    plain = recipe.resolved()
    for part in keys:
        location = ".".join(map(str, part))
        spec = (owner_of(plain, part) or {}).get(str(part[-1]))
        if spec is not None and then.get(location) != recipe.code.get(location):
            kind = PARTS[part]
            entry = registry.entries.get((kind, spec["use"]))
            found[location] = f"{kind} '{spec['use']}'" + (f" ({entry.brought_by})" if entry else "")
    if isinstance(recipe.model, GraftedModel):
        location = ".".join(map(str, NETWORK_KEYS))
        if then.get(location) != recipe.code.get(location):
            found[location] = f"the network {recipe.model.graft.network}"
    return found


def other_code(recipe: Recipe, card: Mapping[str, Any], registry: Registry) -> str | None:
    """Describe how the code of a network's parts differs from that at training; `None` if it does not differ.

    Parts without a hash in the card are ignored: cards of pcsr 0.1.0 have none.
    """
    written = card.get("recipe")
    then = written.get("code", {}) if isinstance(written, dict) else {}
    then = then if isinstance(then, dict) else {}
    differences = []
    for location, part in changed(recipe, written, registry, sorted(MODEL)).items():
        old, new = then.get(location), recipe.code.get(location)
        if old is None and new is not None and not new.startswith("version"):
            continue
        shown = [str(one)[:LONG] if one is not None else "version 1" for one in (old, new)]
        differences.append(f"{part} of code {ascii(shown[0])[1:-1]}, and this is {shown[1]}")
    return f"made by {'; '.join(differences)}" if differences else None
