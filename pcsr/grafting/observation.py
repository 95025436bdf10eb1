"""One pass of a foreign network, and what its layers are given and give."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn

from pcsr.errors import UserError
from pcsr.grafting.injection_point import SeenPoints

Shape = tuple[int, ...]


class NotRunError(UserError):
    """The network cannot be run on the probe."""


@dataclass
class Observation:
    """The outputs of a network and of its layers in one pass."""

    result: Any = None
    """Output of the network."""
    outputs: dict[str, list[Any]] = field(default_factory=dict)
    """For each layer, by its dotted name, and each of its calls: the shape of its output, or the output's type if it is
    no tensor."""
    features: Tensor | None = None
    """Output of the grafted layer."""
    clouds: list[tuple[SeenPoints, Tensor]] = field(default_factory=list)
    """Arguments and outputs of layers that may be clouds, in the order in which they were seen, up to the output of the
    grafted layer."""


def observe(network: nn.Module, at: str | None, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Observation:
    """Run a network without gradients in `eval` mode. Its state does not change.

    Args:
        network: network to run.
        at: dotted name of the grafted layer, if it has one.
        args: arguments by position.
        kwargs: arguments by keyword.

    Raises:
        NotRunError: the network raises an error.
    """
    seen = Observation()
    layer = None if at is None else network.get_submodule(at)
    names: dict[nn.Module, list[str]] = {}
    for name, module in network.named_modules(remove_duplicate=False):
        names.setdefault(module, []).append(name)
    calls: dict[nn.Module, list[Any]] = {module: [] for module in names}

    def before(module: nn.Module, given: tuple[Any, ...], by_name: dict[str, Any]) -> None:
        for position, value in enumerate(given):
            note(module, position, value)
        for name, value in by_name.items():
            note(module, name, value)

    def after(module: nn.Module, _given: Any, output: Any) -> None:
        calls[module].append(tuple(output.shape) if isinstance(output, Tensor) else type(output))
        if module is layer and seen.features is None and isinstance(output, Tensor):
            seen.features = output.detach().clone()
        note(module, None, output)

    def note(module: nn.Module, key: int | str | None, value: Any) -> None:
        if seen.features is None and isinstance(value, Tensor) and value.dim() == 3 and value.is_floating_point():
            for axis in (axis for axis in (1, 2) if value.shape[axis] == 3):
                place = SeenPoints(names[module][0], key, "bnc" if axis == 2 else "bcn")
                seen.clouds.append((place, value.detach().clone()))

    handles = []
    try:
        for module in names:
            if not isinstance(module, torch.jit.ScriptModule):  # which has no hooks
                handles += [
                    module.register_forward_pre_hook(before, with_kwargs=True),
                    module.register_forward_hook(after),
                ]
        with quiet(network, tensor_like(network).device):
            seen.result = network(*args, **kwargs)
    except (Exception, SystemExit) as error:  # foreign code may raise any error
        text = f"{type(error).__name__}: {one_line(error)}".rstrip(".: ")
        if "cuda" in text.lower() and not torch.cuda.is_available():
            text += ". It needs a CUDA device, and there is none here"
        raise NotRunError(text) from error
    finally:
        for handle in handles:
            handle.remove()
    seen.outputs = {name: calls[module] for module, known in names.items() for name in known if name}
    return seen


def tensor_like(network: nn.Module) -> Tensor:
    """A tensor with the data type and device of the network's weights."""
    return next((weight for weight in network.parameters() if weight.is_floating_point()), torch.zeros(()))


@contextmanager
def quiet(network: nn.Module, device: torch.device) -> Iterator[None]:
    """Disable gradients and set `eval` mode; random state and modes are restored afterwards."""
    modes = [(module, module.training) for module in network.modules()]
    devices = [device] if device.type == "cuda" else []
    try:
        with torch.no_grad(), torch.random.fork_rng(devices):
            network.eval()
            yield
    finally:
        for module, training in modes:
            module.training = training


def one_line(thing: object) -> str:
    """The text of an object without line breaks."""
    return " ".join(str(thing).split())
