"""Checkpoints of training: weights, optimizer state and step, in a safetensors file. Nothing is unpickled."""

import json
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from pcsr.files import save_tensors
from pcsr.weights.file import read_file
from pcsr.weights.fit import fill


def save_training(path: Path, network: nn.Module, optimizer: torch.optim.Optimizer, about: dict[str, Any]) -> None:
    """Save a checkpoint.

    Args:
        path: file to write.
        network: network whose weights are saved.
        optimizer: optimizer whose state is saved.
        about: step, fingerprint and other plain data, stored in the header of the file.

    Raises:
        RunError: the file cannot be written.
    """
    tensors = {f"model.{name}": tensor for name, tensor in network.state_dict().items()}
    for index, state in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer.{index}.{key}": torch.as_tensor(value) for key, value in state.items()}
    save_tensors(path, tensors, {"pcsr": json.dumps(about)})


def load_training(path: Path, network: nn.Module, optimizer: torch.optim.Optimizer) -> dict[str, Any]:
    """Load a checkpoint of `save_training` into a network and an optimizer, and return its `about`.

    Raises:
        UserError: the file is no checkpoint, or its weights do not fit the network.
    """
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
