"""Checkpoints of training: everything that a step changes, in a safetensors file. Nothing is unpickled."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import torch
from torch import Tensor, nn

from pcsr.files import save_tensors
from pcsr.weights.file import read_file
from pcsr.weights.fit import fill


@runtime_checkable
class Stateful(Protocol):
    """What has a state of tensors, such as an average of weights."""

    def state_dict(self) -> dict[str, Tensor]:
        """Return the state."""
        ...

    def load_state_dict(self, state: dict[str, Tensor], /) -> object:
        """Restore the state."""
        ...


def save_training(
    path: Path,
    network: nn.Module,
    optimizer: torch.optim.Optimizer,
    about: dict[str, Any],
    others: Mapping[str, Stateful] | None = None,
) -> None:
    """Save a checkpoint.

    Args:
        path: file to write.
        network: network whose weights are saved.
        optimizer: optimizer whose state is saved.
        about: step, fingerprint and other plain data, stored in the header of the file.
        others: what else has a state, by name; no name contains a dot.

    Raises:
        RunError: the file cannot be written.
    """
    tensors = {f"model.{name}": tensor for name, tensor in network.state_dict().items()}
    for index, state in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{key}": torch.as_tensor(value) for key, value in state.items()}
    for owner, other in (others or {}).items():
        tensors |= {f"{owner}.{name}": tensor for name, tensor in other.state_dict().items()}
    save_tensors(path, tensors, {"pcsr": json.dumps(about)})


def load_training(
    path: Path, network: nn.Module, optimizer: torch.optim.Optimizer, others: Mapping[str, Stateful] | None = None
) -> dict[str, Any]:
    """Load a checkpoint of `save_training` into a network, an optimizer and others, and return its `about`.

    Raises:
        UserError: the file is no checkpoint, or its weights do not fit the network.
    """
    tensors, about = read_file(path)
    fill(network, _of("model", tensors), path)
    state: dict[int, dict[str, Tensor]] = {}
    for name, tensor in _of("optimizer", tensors).items():
        index, key = name.split(".")
        state.setdefault(int(index), {})[key] = tensor
    optimizer.load_state_dict({"state": state, "param_groups": optimizer.state_dict()["param_groups"]})
    for owner, other in (others or {}).items():
        other.load_state_dict(_of(owner, tensors))
    return about


def _of(owner: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Return the tensors of one owner by their own names."""
    prefix = f"{owner}."
    return {name.removeprefix(prefix): tensor for name, tensor in tensors.items() if name.startswith(prefix)}
