"""Checks of what training needs of a part: gradients that arrive, and are right."""

import math
from collections.abc import Callable, Mapping

import torch
from torch import Tensor, nn

from pcsr.testing.check import Skipped
from pcsr.testing.inputs import FEW, call, given, learns_from
from pcsr.testing.stop_gradient import slopes
from pcsr.testing.subject import Subject

DRAWS = 4
"""Instances that are tried: of one a ReLU may be shut by chance."""
STEPS = (1e-6, 1e-7, 1e-5)
"""How far along a direction of length 1 differences reach, in double precision."""
SAME = 1e-3
"""Part of a derivative that two ways of working it out may differ by; ReLUs and maxima have kinks."""
ROUNDING = 1e-7
"""What rounding makes of a difference where there is no slope, as a part of the value."""


def gradients(subject: Subject) -> None:
    """Gradients reach each layer and whatever learned parts made, and are finite."""
    must: set[str] = set()
    reached: set[str] = set()
    for draw in range(DRAWS):
        module = subject.lively(draw).train()
        tensors = given(module, subject.widths, seed=draw)
        learned = {name: tensors[name].requires_grad_() for name in learns_from(module)}
        must |= learned.keys() | layers(module).keys()
        made = call(module, subject.widths.rate, tensors)
        if made.requires_grad:
            torch.autograd.backward((made * torch.randn_like(made)).sum())
        reached |= arrived(subject, {**{name: [t] for name, t in learned.items()}, **layers(module)})
        if not must - reached:
            break
    demand(subject, must, reached)


def layers(module: nn.Module, prefix: str = "") -> dict[str, list[nn.Parameter]]:
    """Each layer that has weights of its own to learn, by name.

    A layer is reached if one of its weights is: some biases can have no gradient, such as one before a softmax.
    """
    found = {}
    for name, layer in module.named_modules():
        own = [weight for weight in layer.parameters(recurse=False) if weight.requires_grad]
        if own:
            found[f"layer '{prefix}{name or type(module).__name__}'"] = own
    return found


def arrived(subject: Subject, groups: Mapping[str, list[Tensor] | list[nn.Parameter]]) -> set[str]:
    """Groups of which a tensor has a gradient that is somewhere not zero.

    Raises:
        CheckFailed: a gradient is not finite.
    """
    found = set()
    for name, tensors in groups.items():
        for tensor in tensors:
            if tensor.grad is None:
                continue
            if not tensor.grad.isfinite().all():
                raise subject.failure(
                    f"the gradient of {name} is not finite",
                    "finite gradients",
                    "look for roots and norms at zero, and for divisions by it",
                )
            if tensor.grad.any():
                found.add(name)
    return found


def demand(subject: Subject, must: set[str], reached: set[str]) -> None:
    """Raises CheckFailed where something that learns got no gradient."""
    lost = sorted(must - reached)
    if lost:
        raise subject.failure(
            f"no gradient reaches {lost[0]}" + (f" nor {len(lost) - 1} others" if len(lost) > 1 else ""),
            "that training moves every layer of the part, and what came before it",
            "look for detach, no_grad, rounding and indices on the way; set requires_grad=False for fixed weights",
        )


def gradcheck(subject: Subject) -> None:
    """In double precision autograd's derivative is that of differences, by the input and by the weights."""
    module = subject.lively()
    tensors = given(module, subject.widths, count=FEW, batch=2)
    leaves = {name: tensors[name].requires_grad_() for name in learns_from(module)}
    weigh: list[Tensor] = []

    def value() -> Tensor:
        made = call(module, subject.widths.rate, tensors)
        if not weigh:
            weigh.append(torch.randn(made.shape, dtype=made.dtype))
        return (made * weigh[0]).sum()

    compare(subject, value, *({name: leaf} for name, leaf in leaves.items()), trained(module))


def trained(module: nn.Module) -> dict[str, Tensor]:
    """The weights that training moves."""
    return {name: weight for name, weight in module.named_parameters() if weight.requires_grad}


def compare(subject: Subject, value: Callable[[], Tensor], *groups: Mapping[str, Tensor]) -> None:
    """Raises CheckFailed where the derivative is wrong by all tensors of a group; the message names one by which it is.

    Many weights are moved at once, since each run of the part takes its time.
    """
    if not any(groups):
        raise Skipped(f"{subject} has no weights and gets nothing that was learned: there is no derivative to check")
    for leaves in filter(None, groups):
        found = _mismatch(value, leaves)
        if found is None:
            continue
        for name, leaf in leaves.items():
            one = _mismatch(value, {name: leaf})
            if one is not None:
                found = f"{one} by {name}"
                break
        raise subject.failure(
            f"its derivative is wrong: {found}",
            "that autograd and differences agree",
            "look at functions with a backward of your own, and at what is changed in place",
        )


def _mismatch(value: Callable[[], Tensor], leaves: Mapping[str, Tensor]) -> str | None:
    """What is wrong along each of several random directions; None where nothing is.

    A result may jump, as where a step of it is itself a slope: some difference then reaches over no jump. Where it is
    rounded much, a longer one is exact enough.
    """
    found = None
    for step in STEPS:
        direction = {name: torch.randn(leaf.shape, dtype=leaf.dtype) for name, leaf in leaves.items()}
        length = math.sqrt(sum(float(way.square().sum()) for way in direction.values()))
        slope, difference, size = slopes(value, leaves, {n: way / length for n, way in direction.items()}, step)
        if abs(slope - difference) <= SAME * max(abs(slope), abs(difference)) + ROUNDING * max(1.0, abs(size)):
            return None
        found = found or f"{slope:.6g} by autograd, {difference:.6g} by differences"
    return found
