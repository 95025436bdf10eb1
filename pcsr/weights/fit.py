"""Loading of tensors into a network after a comparison of names and shapes."""

from collections.abc import Mapping
from pathlib import Path

from torch import Tensor, nn

from pcsr.errors import UserError

RETRAIN = "They may come from another version of its parts: train again, or install that version"
"""Remedy for weights of unknown origin that do not fit a network."""


def fill(network: nn.Module, tensors: Mapping[str, Tensor], path: Path, remedy: str = RETRAIN) -> None:
    """Load tensors into a network. If they do not fit, the network is not changed.

    Raises:
        UserError: names or shapes differ; the message says which, and the remedy.
    """
    check_fit(network, {name: tuple(tensor.shape) for name, tensor in tensors.items()}, path, remedy)
    network.load_state_dict(dict(tensors))


def check_fit(network: nn.Module, shapes: Mapping[str, tuple[int, ...]], path: Path, remedy: str) -> None:
    """Check that a network's weights and those in a file have equal names and shapes.

    Raises:
        UserError: names or shapes differ; the message says which, and the remedy.
    """
    wanted = {name: tuple(tensor.shape) for name, tensor in network.state_dict().items()}
    wrong = [f"the file has no {name}" for name in wanted if name not in shapes]
    wrong += [f"the network has no {name}" for name in shapes if name not in wanted]
    wrong += [
        f"{name} is {shapes[name]} in the file, {shape} in the network"
        for name, shape in wanted.items()
        if name in shapes and shapes[name] != shape
    ]
    if wrong:
        more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
        raise UserError(
            f"the weights in {path} do not fit this {type(network).__name__}: {'; '.join(wrong[:3])}{more}. {remedy}"
        )


def fill_matching(network: nn.Module, tensors: Mapping[str, Tensor], path: Path) -> None:
    """Load the tensors that a network has too, by name and shape. Its other weights keep their values.

    Raises:
        UserError: there are none.
    """
    own = network.state_dict()
    matching = {name: tensor for name, tensor in tensors.items() if name in own and own[name].shape == tensor.shape}
    if not matching:
        raise UserError(
            f"training cannot start from {path}: it has no tensor of the name and shape of one of this "
            f"{type(network).__name__}. Name weights of a network with some of the same parts, or leave out train.start"
        )
    network.load_state_dict({**own, **matching})
