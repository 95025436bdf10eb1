"""Weights with their recipe, and the state of a training run. All safetensors: nothing is unpickled."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from torch import Tensor, nn

from pcsr.errors import UserError
from pcsr.files import save_tensors
from pcsr.model import Network, build
from pcsr.recipe import Recipe, from_resolved
from pcsr.registry import Registry


def save_weights(path: Path, network: nn.Module, card: dict[str, Any]) -> None:
    """Write weights; the card (recipe, data fingerprint, metrics, version) becomes the file's header."""
    save_tensors(path, network.state_dict(), {"pcsr": json.dumps(card)})


def read_card(path: Path) -> dict[str, Any]:
    """The card of a weights file, without reading the weights.

    Raises:
        UserError: it is no weights file of pcsr.
    """
    return _read(path, tensors=False)[1]


def load_weights(path: Path, registry: Registry) -> tuple[Network, Recipe, dict[str, Any]]:
    """A network ready for use (in `eval` mode), its recipe and its card.

    Raises:
        UserError: no weights file, a part that is not installed, or weights that don't fit the recipe.
    """
    tensors, card = _read(path)
    if "recipe" not in card:
        raise UserError(
            f"{path} holds no recipe, so nobody knows which network its weights are of: it is no weights file"
        )
    recipe = from_resolved(card["recipe"], registry)
    network = build(recipe, registry)
    fill(network, tensors, path)
    return network.eval(), recipe, card


def fill(network: nn.Module, tensors: Mapping[str, Tensor], path: Path) -> None:
    """Put tensors into a network.

    Raises:
        UserError: names or shapes differ; the message says which.
    """
    wanted = network.state_dict()
    wrong = [f"{name} is missing" for name in wanted if name not in tensors]
    wrong += [f"{name} is unknown" for name in tensors if name not in wanted]
    wrong += [
        f"{name} is {tuple(tensors[name].shape)}, not {tuple(tensor.shape)}"
        for name, tensor in wanted.items()
        if name in tensors and tensors[name].shape != tensor.shape
    ]
    if wrong:
        more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
        raise UserError(
            f"the weights in {path} do not fit the network of their recipe: {'; '.join(wrong[:3])}{more}. "
            f"They come from another version of its parts: train again, or install that version"
        )
    network.load_state_dict(dict(tensors))


def save_training(path: Path, network: nn.Module, optimizer: torch.optim.Optimizer, about: dict[str, Any]) -> None:
    """Write all that training needs to go on: weights, optimiser state, and `about` (step, fingerprint)."""
    tensors = {f"model.{name}": tensor for name, tensor in network.state_dict().items()}
    for index, state in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{key}": torch.as_tensor(value) for key, value in state.items()}
    save_tensors(path, tensors, {"pcsr": json.dumps(about)})


def load_training(path: Path, network: nn.Module, optimizer: torch.optim.Optimizer) -> dict[str, Any]:
    """Restore what `save_training` wrote; returns its `about`."""
    tensors, about = _read(path)
    prefix = "model."
    fill(network, {n.removeprefix(prefix): t for n, t in tensors.items() if n.startswith(prefix)}, path)
    state: dict[int, dict[str, Tensor]] = {}
    for name, tensor in tensors.items():
        if name.startswith("optimizer."):
            _, index, key = name.split(".")
            state.setdefault(int(index), {})[key] = tensor
    optimizer.load_state_dict({"state": state, "param_groups": optimizer.state_dict()["param_groups"]})
    return about


def _read(path: Path, *, tensors: bool = True) -> tuple[dict[str, Tensor], dict[str, Any]]:
    if not path.is_file():
        raise UserError(f"{path}: there is no such weights file")
    try:
        with safe_open(path, "pt") as file:
            card = json.loads((file.metadata() or {})["pcsr"])
            return ({name: file.get_tensor(name) for name in file.keys()} if tensors else {}), card  # noqa: SIM118
    except (SafetensorError, KeyError, ValueError) as error:
        raise UserError(
            f"{path} is not a weights file of pcsr ({type(error).__name__}: {error}): "
            f"delete it, and `pcsr run` trains it again"
        ) from error
