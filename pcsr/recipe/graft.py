"""Grafts in recipes: the file of the foreign network, its weights, and mistakes in both."""

import inspect
from pathlib import Path
from typing import Any

from pcsr.errors import UserError
from pcsr.files import sha256
from pcsr.plugins.loading import add_file
from pcsr.plugins.networks import find_network
from pcsr.plugins.networks import network_code as code_of
from pcsr.plugins.registry import Registry
from pcsr.recipe.graft_section import Graft
from pcsr.recipe.part_keys import NETWORK, NETWORK_KEYS, is_graft
from pcsr.recipe.schema import Recipe
from pcsr.recipe.source import Location, Mistake, Source
from pcsr.validation_messages import shown, shown_path

NETWORK_PART = ("model", "graft", "fusion")
"""Key of the part with which the network of a graft is checked: both are needed for inference."""


def load_network(source: Source, registry: Registry) -> None:
    """Load the file that a recipe names for its graft, and put the file's name in place of its path.

    This is done for recipe files alone. A recipe from a weights file names a file that the user has to hand in.

    Args:
        source: data of the recipe, which is changed; mistakes are added to it.
        registry: gets the file.
    """
    graft = source.data["model"]["graft"] if is_graft(source.data) else None
    if not isinstance(graft, dict):
        return
    _load_file(source, graft, registry)
    if graft.get("weights") is not None:
        _name_weights(source, graft)


def _load_file(source: Source, graft: dict[str, Any], registry: Registry) -> None:
    written, location = graft.get("network"), source.location(NETWORK_KEYS)
    if not isinstance(written, str):
        return  # the schema reports it
    file, colon, name = written.rpartition(":")
    path = _folder(location) / Path(file).expanduser()
    network = f"{path.name}:{name}"
    if not colon or not NETWORK.fullmatch(network):
        text = f"model.graft.network must be FILE:CLASS, such as network.py:Net, got {shown(written)}"
        source.mistakes.append(Mistake(location, text))
        return
    graft["network"] = network
    handed_in = any(known.name == path.name for known in registry.modules)
    try:
        if path.is_file() or not handed_in:
            add_file(registry, path)
    except UserError as error:
        source.mistakes.append(Mistake(location, f"model.graft.network: {error}"))


def _name_weights(source: Source, graft: dict[str, Any]) -> None:
    """Replace the name of the network's weights by the path and hash of their file."""
    keys = ("model", "graft", "weights")
    written = graft["weights"]
    named = written if isinstance(written, dict) else {"use": written}
    use = named.get("use")
    location = source.location((*keys, "use") if isinstance(written, dict) else keys)
    if not isinstance(use, str) or not use:
        return  # the schema reports it
    path = _folder(location) / Path(use).expanduser()
    if not path.is_file():
        text = f"model.graft.weights: there is no file {shown_path(path)}"
        source.mistakes.append(Mistake(location, text))
        graft["weights"] = None
        return
    found = sha256(path)
    if named.get("sha256", found) != found:
        text = f"model.graft.weights: {shown_path(path)} has the hash {found[:12]}…, and sha256 is another: remove it"
        source.mistakes.append(Mistake(location, text))
    graft["weights"] = {"use": str(path), "sha256": found}


def _folder(location: Location) -> Path:
    """Return the folder to which a path in a recipe is relative: its file's, or the current one on the command line."""
    return Path(location.origin).parent if location.line else Path()


def network_mistakes(source: Source, registry: Registry) -> list[Mistake]:
    """List the mistakes in the network of a graft: its file lacks the class, or the class does not take the options."""
    graft = source.data["model"]["graft"]
    if not isinstance(graft, dict) or not isinstance(graft.get("network"), str):
        return []
    location = source.location(NETWORK_KEYS)
    if any(mistake.location == location for mistake in source.mistakes):
        return []
    try:
        _, made_by = find_network(registry, graft["network"])
    except UserError as error:
        return [Mistake(location, f"model.graft.network: {error}")]
    options = graft.get("options", {})
    if not isinstance(options, dict) or not all(isinstance(key, str) for key in options):
        return []
    try:
        inspect.signature(made_by).bind(**options)
    except (TypeError, ValueError) as error:  # ValueError: it has no signature
        if isinstance(error, TypeError):
            text = f"model.graft.options: {graft['network']} cannot be called with {shown(options)}: {error}"
            return [Mistake(source.location(("model", "graft", "options")), text)]
    return []


def graft_mistakes(source: Source, recipe: Recipe, graft: Graft) -> list[Mistake]:
    """List contradictions between a graft and the rest of its recipe."""
    keys = ("model", "graft", "frozen")
    if graft.is_frozen and recipe.weights is None and recipe.touch_range[1] == 0:
        text = (
            "model.graft.frozen: the network is not trained, and without touches its tactile parts are not either: set "
            "train.touches to the number of touches in training, or `frozen: false`"
        )
        return [Mistake(source.location(keys), text)]
    if isinstance(graft.points, int) and graft.points > len(graft.arguments):
        text = f"model.graft.points is {graft.points}, and there are {len(graft.arguments)} other arguments: add them"
        return [Mistake(source.location(("model", "graft", "points")), text)]
    return []


def network_code(data: dict[str, Any], registry: Registry) -> str | None:
    """Return the hash of the code of a graft's network; None if its file is not loaded."""
    graft = data["model"]["graft"]
    network = graft.get("network") if isinstance(graft, dict) else None
    try:
        return code_of(registry, network) if isinstance(network, str) else None
    except UserError:
        return None
