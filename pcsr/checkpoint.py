"""Weights with their recipe, and the state of a training run. All safetensors: nothing is unpickled."""

import hashlib
import json
import re
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from pcsr import __version__
from pcsr.errors import UserError
from pcsr.files import save_tensors
from pcsr.model import Network, build
from pcsr.outline import bounded, outline
from pcsr.recipe import MODEL, Recipe, check_card
from pcsr.recipe.compose import PARTS
from pcsr.recipe.source import Keys
from pcsr.registry import Entry, Registry
from pcsr.weights.file import read_file, read_shapes

OURS = "pcsr"
"""The distribution whose parts everybody has."""
FILE = "file"
"""The version of a part that came from a file, not from an installed distribution."""
PLAIN = {"kind": r"[a-z]+", "name": r"[\w.-]+", "owner": r"[\w. -]+", "version": r"[\w.+!-]+"}
"""What a card may say of a part. It ends up in a command that a person is told to run, so nothing else is read."""
LONG = 100
"""Characters of a name in a message, of which a card may have millions."""
ANEW = "They come from another version of its parts: train again, or install that version"


def save_weights(
    path: Path, network: nn.Module, card: dict[str, Any], registry: Registry | None = None, *, half: bool = False
) -> None:
    """Write weights; the card (recipe, data fingerprint, metrics, version) becomes the file's header.

    Args:
        path: the file.
        network: whose weights.
        card: what to say of them. The hash of the weights is added as `sha256`.
        registry: where the recipe's parts are from; those that are not pcsr's own are then added as `parts`.
        half: store them in half precision, in half the space. Loading gives single precision again; whole numbers stay.

    Raises:
        UserError: a weight is too large for half precision.
        RunError: the file can't be written.
    """
    tensors = network.state_dict()
    if half:
        tensors = {name: _halved(name, tensor) for name, tensor in tensors.items()}
    card = {**card, "sha256": tensors_hash(tensors)}
    if registry is not None and "recipe" in card:
        card["parts"] = foreign_parts(card["recipe"], registry)
    save_tensors(path, tensors, {"pcsr": json.dumps(card)})


def _halved(name: str, tensor: Tensor) -> Tensor:
    if not tensor.is_floating_point():
        return tensor
    halved = tensor.half()
    if tensor.isfinite().all() and not halved.isfinite().all():
        raise UserError(
            f"the weights '{name}' reach {tensor.abs().max():.4g}, and half precision ends at "
            f"{torch.finfo(torch.half).max:.0f}: store them in single precision"
        )
    return halved


def tensors_hash(tensors: Mapping[str, Tensor]) -> str:
    """SHA-256 over the names, types, shapes and bytes of tensors, in the order of their names."""
    digest = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        digest.update(json.dumps([name, str(tensor.dtype), list(tensor.shape)]).encode() + b"\n")
        digest.update(tensor.detach().cpu().reshape(-1).contiguous().view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()


def foreign_parts(recipe: Mapping[str, Any], registry: Registry) -> list[dict[str, str]]:
    """The parts of a resolved recipe that do not come with pcsr: kind, name, owner and version of each.

    Of a plugin file the owner is its name, without the folder, and the version is "file".
    """
    parts = []
    for kind, name in _used(recipe):
        entry = registry.entries.get((kind, name))
        if entry is not None and entry.owner != OURS:
            parts.append({"kind": kind, "name": name, "owner": _owner(entry), "version": entry.version})
    return parts


def _used(recipe: Mapping[str, Any], places: Collection[Keys] = PARTS.keys()) -> list[tuple[str, str]]:
    """Kind and name of each part that a recipe names at these places, each once, whatever else is wrong with it."""
    used = []
    for (section, place), kind in ((keys, kind) for keys, kind in PARTS.items() if keys in places):
        inner = recipe.get(str(section))
        part = inner.get(place) if isinstance(inner, dict) else None
        if isinstance(part, dict) and isinstance(part.get("use"), str):
            used.append((kind, part["use"]))
    return list(dict.fromkeys(used))


def _owner(entry: Entry) -> str:
    """Who brings a part, without the folders that a file lies in."""
    return Path(entry.owner).name if entry.version == FILE else entry.owner


def read_card(path: Path) -> dict[str, Any]:
    """The card of a weights file, without reading the weights.

    Raises:
        UserError: it is no weights file of pcsr.
    """
    return read_file(path, tensors=False)[1]


def load_weights(path: Path, registry: Registry) -> tuple[Network, Recipe, dict[str, Any]]:
    """A network ready for use (in `eval` mode), its recipe and its card.

    Of the recipe only the parts of the network must be installed. Those of the data and the training are as the card
    says.

    Raises:
        UserError: no weights file, one that was damaged or changed, a part that is not installed, or weights that
            don't fit the recipe. The message says what to do.
    """
    card = read_card(path)
    recipe = card.get("recipe")
    if not isinstance(recipe, dict):
        raise UserError(
            f"{path} holds no recipe, so nobody knows which network its weights are of: it is no weights file"
        )
    _check_parts(path, card, registry)
    remedy = _remedy(card, registry)
    checked = _checked(path, recipe, registry, remedy)
    network = _build(path, checked, registry, remedy)
    tensors, _ = read_file(path)
    if "sha256" in card and card["sha256"] != tensors_hash(tensors):
        raise UserError(f"{path} has changed since it was written (its hash differs): get it again")
    fill(network, tensors, path, remedy)
    for name, tensor in network.state_dict().items():
        if not torch.isfinite(tensor).all():
            raise UserError(f"{path} is damaged: its weights '{name}' are not all finite: get it again, or train again")
    return network.eval(), checked, card


@contextmanager
def _building(path: Path, remedy: str) -> Iterator[None]:
    """Says what went wrong: nobody knows what parts make of options that were not meant for them."""
    try:
        yield
    except Exception as error:
        said = "; ".join(str(error).splitlines())[:400] or type(error).__name__
        raise UserError(f"the network of {path} cannot be built here ({said}). {remedy}") from error


def _checked(path: Path, recipe: dict[str, Any], registry: Registry, remedy: str) -> Recipe:
    """The recipe in a card."""
    with _building(path, remedy):
        return check_card(recipe, registry, "recipe in the weights")


def _build(path: Path, recipe: Recipe, registry: Registry, remedy: str) -> Network:
    """The network of a recipe, which is first compared with the file without memory for its weights.

    Raises:
        UserError: it cannot be built, or is not that of the file.
    """
    shapes = read_shapes(path)
    with _building(path, remedy):
        planned = outline(recipe, registry, len(shapes))
    if planned is not None:
        _compare(planned, shapes, path, remedy)
    with _building(path, remedy), bounded(len(shapes)):
        return build(recipe, registry)


def _parts(card: Mapping[str, Any]) -> list[dict[str, str]]:
    """What a card says of foreign parts, as far as it can be believed."""
    parts = card.get("parts")
    return [
        part
        for part in (parts if isinstance(parts, list) else [])
        if isinstance(part, dict)
        and all(isinstance(part.get(key), str) and re.fullmatch(shape, part[key]) for key, shape in PLAIN.items())
    ]


def _check_parts(path: Path, card: Mapping[str, Any], registry: Registry) -> None:
    """Name the parts of the network that are not here, and what brings them.

    Raises:
        UserError: at least one is not here.
    """
    known = {(part["kind"], part["name"]): part for part in _parts(card)}
    missing = [part for part in _used(card["recipe"], MODEL) if part not in registry.entries]
    if missing:
        needed = "; and ".join(_needed(*part, known.get(part), registry) for part in missing)
        raise UserError(f"the weights {path} need {needed}")


def _needed(kind: str, name: str, part: Mapping[str, str] | None, registry: Registry) -> str:
    """A part that is not here, and the remedy."""
    if part is None:  # before it was noted, or a part of ours that has gone
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


def _remedy(card: Mapping[str, Any], registry: Registry) -> str:
    """What to do about weights that don't fit: which versions made them, and which are here."""
    made, here, install, files = [], [], [], []
    for part in _parts(card):
        entry = registry.entries.get((part["kind"], part["name"]))
        if entry is None or (_owner(entry), entry.version) == (part["owner"], part["version"]):
            continue
        made.append(f"{part['kind']} '{part['name']}' of {part['owner']} {part['version']}")
        here.append(f"{_owner(entry)} {entry.version}")
        if part["version"] == FILE:
            files.append(part["owner"])
        else:
            install.append(f"{part['owner']}=={part['version']}")
    version = card.get("version")
    if isinstance(version, str) and re.fullmatch(PLAIN["version"], version) and version != __version__:
        made.append(f"pcsr {version}")
        here.append(f"pcsr {__version__}" if here else __version__)
        install.append(f"pcsr=={version}")
    if not made:
        return ANEW
    ways = [f"pip install {' '.join(dict.fromkeys(install))}"] if install else []
    ways += [f"hand in {file} with --plugin" for file in dict.fromkeys(files)]
    return f"They were made by {' and '.join(made)}, this is {' and '.join(here)}: {', '.join(ways)}, or train again"


def fill(network: nn.Module, tensors: Mapping[str, Tensor], path: Path, remedy: str = ANEW) -> None:
    """Put tensors into a network.

    Raises:
        UserError: names or shapes differ; the message says which, and the remedy.
    """
    _compare(network, {name: tuple(tensor.shape) for name, tensor in tensors.items()}, path, remedy)
    network.load_state_dict(dict(tensors))


def _compare(network: nn.Module, shapes: Mapping[str, tuple[int, ...]], path: Path, remedy: str) -> None:
    """Compare the weights of a network with those of a file.

    Raises:
        UserError: names or shapes differ; the message says which, and the remedy.
    """
    wanted = {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()}
    wrong = [f"{name} is missing" for name in wanted if name not in shapes]
    wrong += [f"{name} is unknown" for name in shapes if name not in wanted]
    wrong += [
        f"{name} is {shapes[name]}, not {shape}"
        for name, shape in wanted.items()
        if name in shapes and shapes[name] != shape
    ]
    if wrong:
        more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
        raise UserError(
            f"the weights in {path} do not fit the network of their recipe: {'; '.join(wrong[:3])}{more}. {remedy}"
        )


def save_training(path: Path, network: nn.Module, optimizer: torch.optim.Optimizer, about: dict[str, Any]) -> None:
    """Write all that training needs to go on: weights, optimiser state, and `about` (step, fingerprint)."""
    tensors = {f"model.{name}": tensor for name, tensor in network.state_dict().items()}
    for index, state in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{key}": torch.as_tensor(value) for key, value in state.items()}
    save_tensors(path, tensors, {"pcsr": json.dumps(about)})


def load_training(path: Path, network: nn.Module, optimizer: torch.optim.Optimizer) -> dict[str, Any]:
    """Restore what `save_training` wrote; returns its `about`."""
    tensors, about = read_file(path)
    prefix = "model."
    fill(network, {n.removeprefix(prefix): t for n, t in tensors.items() if n.startswith(prefix)}, path)
    state: dict[int, dict[str, Tensor]] = {}
    for name, tensor in tensors.items():
        if name.startswith("optimizer."):
            _, index, key = name.split(".")
            state.setdefault(int(index), {})[key] = tensor
    optimizer.load_state_dict({"state": state, "param_groups": optimizer.state_dict()["param_groups"]})
    return about
