"""Weights with their recipe, and the state of a training run. All safetensors: nothing is unpickled."""

import hashlib
import json
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from pcsr.errors import PcsrWarning, UserError
from pcsr.files import save_tensors
from pcsr.network.network import Network, build
from pcsr.network.origins import ANEW, check_parts, foreign_parts, made_by, other_code
from pcsr.network.outline import bounded, outline
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe, check_card
from pcsr.weights.file import read_file, read_shapes


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


def read_card(path: str | Path) -> dict[str, Any]:
    """The card of a weights file, without reading the weights.

    Raises:
        UserError: it is no weights file of pcsr.

    Examples:
        >>> card = pcsr.read_card(pcsr.load("tapsr").path)
        >>> card["recipe"]["data"]["rate"]
        16
    """
    return read_file(Path(path), tensors=False)[1]


def load_weights(path: Path, registry: Registry) -> tuple[Network, Recipe, dict[str, Any]]:
    """A network ready for use (in `eval` mode), its recipe and its card.

    Of the recipe only the parts of the network must be installed. Those of the data and the training are as the card
    says.

    Raises:
        UserError: no weights file, one that was damaged or changed, a part that is not installed, or weights that
            don't fit the recipe. The message says what to do.

    Warns:
        PcsrWarning: the code of a part is not that with which they were made.
    """
    card = read_card(path)
    recipe = card.get("recipe")
    if not isinstance(recipe, dict):
        raise UserError(
            f"{path} holds no recipe, so nobody knows which network its weights are of: it is no weights file"
        )
    check_parts(path, card, registry)
    remedy = made_by(card, registry)
    checked = _checked(path, recipe, registry, remedy)
    said = other_code(checked, card, registry)
    if said:
        warnings.warn(f"the weights {path} were {said}: results may differ", PcsrWarning, stacklevel=2)
        remedy = f"They were {said}: hand in the code that made them, or train again"
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
