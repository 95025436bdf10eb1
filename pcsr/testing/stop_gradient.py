"""Derivatives by differences, of functions that keep some of their values out of the gradient on purpose.

A network looks for neighbours under `torch.no_grad`, and a GAN judges a detached cloud. A plain difference quotient
sees such values move and calls the gradient wrong. Here they are held fixed, as the gradient takes them to be.
"""

from collections.abc import Callable, Mapping
from typing import Any

import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._pytree import tree_map


class StopGradients(TorchFunctionMode):
    """The first run notes all that is detached or computed without gradients; the next ones get the same again."""

    def __init__(self) -> None:
        super().__init__()
        self._kept: list[Any] = []
        self._place = 0
        self._again = False
        self._off = False

    def rewind(self) -> None:
        """Begin another run."""
        self._again, self._place, self._off = True, 0, False

    def __torch_function__(
        self,
        func: Callable[..., Any],
        types: Any,
        args: tuple[Any, ...] = (),
        kwargs: dict[str, Any] | None = None,
    ) -> Any:
        """Stand between the part and each of torch's functions."""
        result = func(*args, **(kwargs or {}))
        if func is torch._C._set_grad_enabled:
            self._off = not args[0]
            return result
        # A custom `autograd.Function` computes without gradients too, but says so in C++ and is not held.
        if not (self._off or func in (Tensor.detach, torch.detach)):
            return result
        if not self._again:
            self._kept.append(_copied(result))
            return result
        kept = self._kept[self._place]
        self._place += 1
        return _copied(kept)


def _copied(result: Any) -> Any:
    # Work under no_grad may go on in place.
    return tree_map(lambda one: one.clone() if isinstance(one, Tensor) else one, result)


def slopes(
    value: Callable[[], Tensor], leaves: Mapping[str, Tensor], direction: Mapping[str, Tensor], step: float
) -> tuple[float, float, float]:
    """The derivative of a number along a direction: by autograd, by a central difference; and the number.

    Args:
        value: computes the number from `leaves`, in double precision.
        leaves: tensors that require gradients; they are moved and put back.
        direction: for each leaf a tensor of its shape, together of length 1.
        step: how far along it the difference reaches.
    """
    held = StopGradients()
    with held:
        number = value()
    slope = 0.0
    if number.requires_grad:
        gradients = torch.autograd.grad(number, list(leaves.values()), allow_unused=True)
        pairs = zip(gradients, direction.values(), strict=True)
        slope = sum(float((gradient * along).sum()) for gradient, along in pairs if gradient is not None)
    start = {name: leaf.detach().clone() for name, leaf in leaves.items()}
    numbers = []
    for way in (step, -step, 0.0):
        with torch.no_grad():
            for name, leaf in leaves.items():
                leaf.copy_(start[name] + way * direction[name])
        if way:
            held.rewind()
            with held:
                moved = value()
            numbers.append(float(moved.detach()))
    return slope, (numbers[0] - numbers[1]) / (2 * step), float(number.detach())
