"""Checks of the output of network parts: its shape, its precision, and what it must not depend on."""

from collections.abc import Callable
from functools import partial
from typing import Any

import torch
from torch import Tensor

from pcsr.contracts import Backbone, Encoder, Trait, Upsampler, Widths
from pcsr.errors import UserError
from pcsr.testing.check import Skipped
from pcsr.testing.construction import TRAITS
from pcsr.testing.inputs import POINTS, Given, apart, apart_as_sets, call, given, is_set, rows, single
from pcsr.testing.subject import WIDTHS, Subject, channels

ODD = 101
"""A number of points that is no power of two. Touches may join a cloud, so that parts must accept any number."""
CLOSE = 1e-6
"""Largest relative difference of two results that are due to rounding in double precision."""
FAR = 100.0
"""Distance of a cloud that a local part must not notice, in radii of the cloud."""
RATES = (2, 3, 5, 16)
"""Rates at which an upsampler with the trait `ANY_RATE` is run."""


@torch.no_grad()
def shapes(subject: Subject) -> None:
    """The output has the shape of the contract and the input's precision, and is finite; the input is unchanged."""
    first = subject.widths
    for widths in [first, *(other for other in WIDTHS if other != first)]:
        try:
            module = subject.make(widths).eval()
        except UserError:  # the check `builds` looks at refusals
            continue
        for count in (POINTS, ODD) if widths == first else (POINTS,):
            tensors = single(given(module, widths, count=count, batch=2))
            before = {name: tensor.clone() for name, tensor in tensors.items()}
            output = call(module, widths.rate, tensors)
            _shape(subject, module, widths, count, output)
            _sound(subject, output, f"{count} points")
            changed = [name for name, tensor in tensors.items() if not torch.equal(tensor, before[name])]
            if changed:
                raise subject.failure(
                    f"it changes the {changed[0]} that it is given",
                    "that its input stays as it is",
                    "work on a copy, or out of place",
                )


def _shape(subject: Subject, module: Any, widths: Widths, count: int, output: Tensor) -> None:
    """Raises CheckFailed for a wrong shape."""
    wanted: tuple[object, ...]
    if isinstance(module, Encoder | Backbone):
        wanted = (2, count, channels(subject, module))
        right = tuple(output.shape) == wanted
    elif is_set(module):
        least = count * (widths.rate if isinstance(module, Upsampler) else 1)
        wanted = (2, f"{least} or more", 3)
        right = output.dim() == 3 and output.shape[0] == 2 and output.shape[1] >= least and output.shape[2] == 3
    else:
        wanted = (2, count, widths.visual)
        right = tuple(output.shape) == wanted
    if not right:
        raise subject.failure(
            f"for 2 clouds of {count} points and {widths} it gives the shape {tuple(output.shape)}",
            f"({', '.join(map(str, wanted))})",
            "see the contract of its kind in pcsr.contracts",
        )


def _sound(subject: Subject, output: Tensor, what: str) -> None:
    if output.dtype != torch.float32:
        raise subject.failure(
            f"it gives {output.dtype} for torch.float32",
            "the precision of its input",
            "make constants with the input's dtype",
        )
    if not output.isfinite().all():
        raise subject.failure(
            f"for {what} its result is not finite",
            "finite numbers",
            "look for divisions by zero and roots of zero",
        )


def coinciding_points(subject: Subject) -> None:
    """Points may coincide, as in a touch whose points are repeated. Output and gradients are finite."""
    module = subject.perturbed().float().train()
    tensors = single(given(module, subject.widths))
    for name, tensor in tensors.items():
        if name in ("points", "touches"):
            tensor[..., ::4, :] = tensor[..., :1, :]
        if tensor.is_floating_point():
            tensor.requires_grad_()
    output = call(module, subject.widths.rate, tensors)
    _sound(subject, output, "clouds with coinciding points")
    if output.requires_grad:
        torch.autograd.backward(output.square().mean())
    leaves = {**tensors, **dict(module.named_parameters())}
    broken = [name for name, leaf in leaves.items() if leaf.grad is not None and not leaf.grad.isfinite().all()]
    if broken:
        raise subject.failure(
            f"for clouds with coinciding points the gradient of {broken[0]} is not finite",
            "finite gradients",
            "keep roots and norms away from zero: they have no slope there",
        )


@torch.no_grad()
def independent_rows(subject: Subject) -> None:
    """In `eval` mode the output for a cloud does not depend on the other clouds of its batch."""
    module = subject.perturbed()
    tensors = given(module, subject.widths)
    whole = call(module, subject.widths.rate, tensors)
    for row in range(len(whole)):
        alone = call(module, subject.widths.rate, rows(tensors, slice(row, row + 1)))
        gap = apart(whole[row : row + 1], alone)
        if gap > CLOSE:
            raise subject.failure(
                f"cloud {row} of a batch comes out {gap:.2g} different alone",
                "the same result, whatever else is in the batch",
                "keep the axis b apart: no mean, norm or neighbour across it",
            )


@torch.no_grad()
def trait(subject: Subject, which: Trait) -> None:
    """A claimed trait holds. One that is not claimed is tested too, and the check skipped with what was found."""
    module: Any = subject.perturbed()
    holds, found = TRIALS[which](subject, module)
    if which in module.traits:
        if not holds:
            raise subject.failure(
                f"it claims '{which}', but {found}", "what it claims", "mend it, or take the claim out of `traits`"
            )
    elif holds:
        raise Skipped(f"{subject} does not claim '{which}', though it held here: claim it if it is meant to")
    else:
        raise Skipped(f"{subject} does not claim '{which}', and {found}")


def _point_order(subject: Subject, module: Any) -> tuple[bool, str]:
    tensors = given(module, subject.widths)
    order = torch.randperm(POINTS)
    shuffled = {name: t[:, order] if name in ("points", "features") else t for name, t in tensors.items()}
    output, again = (call(module, subject.widths.rate, each) for each in (tensors, shuffled))
    gap = apart_as_sets(again, output) if is_set(module) else apart(again, output[:, order])
    return gap <= CLOSE, f"with its points in another order the result is {gap:.2g} off"


def _touch_order(subject: Subject, module: Any) -> tuple[bool, str]:
    tensors = given(module, subject.widths)
    turned = {n: t.flip(1) if n in ("touches", "touch_features", "mask") else t for n, t in tensors.items()}
    output, again = (call(module, subject.widths.rate, each) for each in (tensors, turned))
    gap = (apart_as_sets if is_set(module) else apart)(again, output)
    return gap <= CLOSE, f"with its touches in another order the result is {gap:.2g} off"


def _any_rate(subject: Subject, module: Any) -> tuple[bool, str]:
    tensors: Given = given(module, subject.widths)
    for rate in RATES:
        try:
            output = call(module, rate, tensors)
        except UserError as error:
            if Trait.ANY_RATE not in module.traits:
                subject.must_name_itself(error)
            return False, f"refuses rate {rate}: {error}"
        if output.shape[1] < rate * POINTS or not output.isfinite().all():
            found = f"at rate {rate} it makes {output.shape[1]} points of {POINTS}, or some that are not finite"
            if Trait.ANY_RATE not in module.traits:
                raise subject.failure(
                    found,
                    f"{rate * POINTS}, or that a rate which it is not built for is refused",
                    "raise a UserError where rate != widths.rate",
                )
            return False, found
    return True, ""


def _local(subject: Subject, module: Any) -> tuple[bool, str]:
    tensors = given(module, subject.widths)
    half = {name: t / 2 if name == "points" else t for name, t in tensors.items()}
    beside = {name: torch.cat([t, t + FAR if name == "points" else t.flip(1)], dim=1) for name, t in half.items()}
    output, both = (call(module, subject.widths.rate, each) for each in (tensors, beside))
    if is_set(module):
        near = [row[row.norm(dim=1) < FAR / 2] for row in both]
        if any(len(row) != output.shape[1] for row in near):
            return False, f"beside another cloud it makes {len(near[0])} points instead of {output.shape[1]}"
        gap = apart_as_sets(torch.stack(near), output / 2)
    else:
        gap = apart(both[:, :POINTS], output)
    return gap <= CLOSE, f"at half of the size and beside a cloud far away the result is {gap:.2g} off"


TRIALS: dict[Trait, Callable[[Subject, Any], tuple[bool, str]]] = {
    Trait.PERMUTATION_EQUIVARIANT: _point_order,
    Trait.TOUCH_PERMUTATION_INVARIANT: _touch_order,
    Trait.ANY_RATE: _any_rate,
    Trait.LOCAL: _local,
}


def trait_checks(kind: str) -> dict[str, Callable[[Subject], None]]:
    """The checks of the traits that parts of a kind can claim."""
    return {f"trait-{one}": partial(trait, which=one) for one in Trait if one in TRAITS[kind]}
