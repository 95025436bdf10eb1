"""The networks of examples/third_party/networks, which know nothing of pcsr, with statistics as after training."""

import importlib.util
from pathlib import Path
from types import ModuleType

import torch
from torch import nn

FOLDER = Path(__file__).parents[1] / "examples" / "third_party" / "networks"
AT = {"kernel_upsampler": "encoder.fuse", "cascade": "second.features"}
"""A layer of each; the second has two features for each point."""
CLASSES = {"kernel_upsampler": "network", "cascade": "Cascade"}


def module(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def network(name: str, seed: int = 0) -> nn.Module:
    torch.manual_seed(seed)
    made: nn.Module = getattr(module(name), CLASSES[name])()
    for layer in made.modules():
        if isinstance(layer, nn.BatchNorm1d | nn.BatchNorm2d):
            nn.init.normal_(layer.running_mean, std=0.1)
            nn.init.uniform_(layer.running_var, 0.5, 2.0)
    return made


def dense(output: object) -> torch.Tensor:
    """The dense cloud (b rn 3) in what one of the networks gives."""
    while not isinstance(output, torch.Tensor):
        assert isinstance(output, tuple | list)
        output = output[0] if output[-1] is None or output[-1].dim() == 0 else output[-1]
    return output if output.shape[2] == 3 else output.transpose(1, 2)
