"""The state of a training run in a file: weights, optimizer state, and how far the run is. Nothing is unpickled."""

import json
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from pcsr.files import save_tensors
from pcsr.weights.file import read_file
from pcsr.weights.fit import fill


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
