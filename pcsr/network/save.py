"""Writer of weights files: safetensors files with a card in the header."""

import json
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from pcsr.errors import UserError
from pcsr.files import save_tensors
from pcsr.network.card import foreign_parts
from pcsr.plugins.registry import Registry
from pcsr.weights.file import tensors_hash


def save_weights(
    path: Path, network: nn.Module, card: dict[str, Any], registry: Registry | None = None, *, half: bool = False
) -> None:
    """Save the weights of a network, with a card in the header of the file.

    Args:
        path: file to write.
        network: network whose weights are saved.
        card: recipe, data fingerprint, version and other plain data. The hash of the weights is added as `sha256`.
        registry: installed parts. If given, the third-party parts of the recipe are added to the card as `parts`.
        half: whether weights are stored in half precision. Integers are not changed, and loading restores single
            precision.

    Raises:
        UserError: a weight is too large for half precision.
        RunError: the file cannot be written.
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
