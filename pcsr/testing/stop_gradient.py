"""Finite differences of functions with values that are detached from the gradient on purpose.

Neighbours are searched under `torch.no_grad`, and a discriminator is trained on a detached cloud. A plain difference
quotient includes the change of such values, which autograd ignores. Here they are kept constant.
"""

from collections.abc import Callable, Mapping
from typing import Any

import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._pytree import tree_map


class FrozenDetached(TorchFunctionMode):
    """Records values that are detached, or computed without gradients, in one run and repeats them in later runs."""

    def __init__(self) -> None:
        super().__init__()
        self._kept: list[Any] = []
        self._place = 0
        self._again = False
        self._off = False

    def rewind(self) -> None:
        """Start another run."""
        self._again, self._place, self._off = True, 0, False

    def __torch_function__(
        self,
        func: Callable[..., Any],
        types: Any,
        args: tuple[Any, ...] = (),
        kwargs: dict[str, Any] | None = None,
    ) -> Any:
        """Record or repeat the result of a function of torch."""
        result = func(*args, **(kwargs or {}))
        if func is torch._C._set_grad_enabled:
            self._off = not args[0]
            return result
        # A custom `autograd.Function` disables gradients in C++, which does not show here.
        if not (self._off or func in (Tensor.detach, torch.detach)):
            return result
        if not self._again:
            self._kept.append(_copied(result))
            return result
        kept = self._kept[self._place]
        self._place += 1
        return _copied(kept)


def _copied(result: Any) -> Any:
    # Code under no_grad may change a result in place.
    return tree_map(lambda one: one.clone() if isinstance(one, Tensor) else one, result)


def slopes(
    value: Callable[[], Tensor], leaves: Mapping[str, Tensor], direction: Mapping[str, Tensor], step: float
) -> tuple[float, float, float]:
    """Compute the derivative of a function along a direction: by autograd, and by a central difference.

    Args:
        value: computes the value of the function from `leaves`, in double precision.
        leaves: tensors that require gradients; they are changed and restored.
        direction: a tensor for each leaf, of its shape; together of length 1.
        step: of the difference.

    Returns:
        The derivative by autograd, the one by the difference, and the value.
    """
    frozen = FrozenDetached()
    with frozen:
        number = value()
    slope = 0.0
    if number.requires_grad:
        gradients = torch.autograd.grad(number, list(leaves.values()), allow_unused=True)
        pairs = zip(gradients, direction.values(), strict=True)
        slope = sum(float((gradient * along).sum()) for gradient, along in pairs if gradient is not None)
    start = {name: leaf.detach().clone() for name, leaf in leaves.items()}
    numbers = []
    for offset in (step, -step, 0.0):
        with torch.no_grad():
            for name, leaf in leaves.items():
                leaf.copy_(start[name] + offset * direction[name])
        if offset:
            frozen.rewind()
            with frozen:
                moved = value()
            numbers.append(float(moved.detach()))
    return slope, (numbers[0] - numbers[1]) / (2 * step), float(number.detach())
