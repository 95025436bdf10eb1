"""Checks of gradients: they reach all layers and are correct."""

import math
from collections.abc import Callable, Mapping

import torch
from torch import Tensor, nn

from pcsr.testing.check import Skipped
from pcsr.testing.inputs import FEW, call, given, learns_from, outputs
from pcsr.testing.stop_gradient import slopes
from pcsr.testing.subject import Subject

DRAWS = 4
"""Number of instances that are tried, since all inputs of a ReLU may be negative by chance."""
STEPS = (1e-6, 1e-7, 1e-5)
"""Steps of the finite differences along a direction of length 1, in double precision."""
SAME = 1e-3
"""Largest relative difference of two derivatives. ReLUs and maxima are not differentiable everywhere."""
ROUNDING = 1e-7
"""Rounding error of a finite difference, relative to the value of the function."""


def gradients(subject: Subject) -> None:
    """Gradients reach each layer and each input that comes from a trained part, and are finite."""
    must: set[str] = set()
    reached: set[str] = set()
    for draw in range(DRAWS):
        module = subject.perturbed(draw).train()
        tensors = given(module, subject.widths, seed=draw)
        learned = {name: tensors[name].requires_grad_() for name in learns_from(module)}
        must |= learned.keys() | layers(module).keys()
        for output in outputs(module, subject.widths.rate, tensors):
            if output.requires_grad:
                torch.autograd.backward((output * torch.randn_like(output)).sum(), retain_graph=True)
        reached |= arrived(subject, {**{name: [t] for name, t in learned.items()}, **layers(module)})
        if not must - reached:
            break
    demand(subject, must, reached)


def layers(module: nn.Module, prefix: str = "") -> dict[str, list[nn.Parameter]]:
    """Trainable weights of each layer, by name.

    A layer counts as reached if one of its weights is: some biases have no gradient, such as one before a softmax.
    """
    found = {}
    for name, layer in module.named_modules():
        own = [weight for weight in layer.parameters(recurse=False) if weight.requires_grad]
        if own:
            found[f"layer '{prefix}{name or type(module).__name__}'"] = own
    return found


def arrived(subject: Subject, groups: Mapping[str, list[Tensor] | list[nn.Parameter]]) -> set[str]:
    """Names of the groups with a tensor whose gradient is not zero.

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
    """Raise CheckFailed if a group has no gradient."""
    lost = sorted(must - reached)
    if lost:
        raise subject.failure(
            f"no gradient reaches {lost[0]}" + (f" nor {len(lost) - 1} others" if len(lost) > 1 else ""),
            "gradients for every layer of the part, and for the parts before it",
            "look for detach, no_grad, rounding and indices in between; set requires_grad=False for fixed weights",
        )


def gradcheck(subject: Subject) -> None:
    """Derivatives by autograd agree with finite differences, by the inputs and by the weights."""
    module = subject.perturbed()
    tensors = given(module, subject.widths, count=FEW, batch=2)
    leaves = {name: tensors[name].requires_grad_() for name in learns_from(module)}
    weigh: list[Tensor] = []

    def value() -> Tensor:
        output = call(module, subject.widths.rate, tensors)
        if not weigh:
            weigh.append(torch.randn(output.shape, dtype=output.dtype))
        return (output * weigh[0]).sum()

    compare(subject, value, *({name: leaf} for name, leaf in leaves.items()), trained(module))


def trained(module: nn.Module) -> dict[str, Tensor]:
    """Trainable weights by name."""
    return {name: weight for name, weight in module.named_parameters() if weight.requires_grad}


def compare(subject: Subject, value: Callable[[], Tensor], *groups: Mapping[str, Tensor]) -> None:
    """Raise CheckFailed if the derivative by the tensors of a group is wrong; the message names one of the tensors.

    All tensors of a group are varied at once, which needs fewer runs of the part.
    """
    if not any(groups):
        raise Skipped(
            f"{subject} has no weights and takes no output of a trained part: there is no derivative to check"
        )
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
    """Describe the mismatch along random directions; None if one of them shows none.

    Several steps are tried: a short one, since the function may be discontinuous, and a long one, since it may be
    rounded.
    """
    found = None
    for step in STEPS:
        direction = {name: torch.randn(leaf.shape, dtype=leaf.dtype) for name, leaf in leaves.items()}
        length = math.sqrt(sum(float(part.square().sum()) for part in direction.values()))
        slope, difference, size = slopes(value, leaves, {n: part / length for n, part in direction.items()}, step)
        if abs(slope - difference) <= SAME * max(abs(slope), abs(difference)) + ROUNDING * max(1.0, abs(size)):
            return None
        found = found or f"{slope:.6g} by autograd, {difference:.6g} by differences"
    return found
