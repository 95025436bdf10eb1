"""Whether the tensors of a file fit a network: names and shapes compared, and the tensors put in."""

from collections.abc import Mapping
from pathlib import Path

from torch import Tensor, nn

from pcsr.errors import UserError

RETRAIN = "They may come from another version of its parts: train again, or install that version"
"""The remedy where nothing is known about the origin of weights that do not fit."""


def fill(network: nn.Module, tensors: Mapping[str, Tensor], path: Path, remedy: str = RETRAIN) -> None:
    """Put tensors into a network; where they do not fit, nothing is changed.

    Raises:
        UserError: names or shapes differ; the message says which, and the remedy.
    """
    check_fit(network, {name: tuple(tensor.shape) for name, tensor in tensors.items()}, path, remedy)
    network.load_state_dict(dict(tensors))


def check_fit(network: nn.Module, shapes: Mapping[str, tuple[int, ...]], path: Path, remedy: str) -> None:
    """Compare the names and shapes of a network's weights with those in a file.

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
