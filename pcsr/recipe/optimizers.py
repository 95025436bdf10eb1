"""Optimizers of torch that a recipe can name, and their options."""

import inspect
from typing import Any

import torch
from pydantic import BaseModel, ConfigDict, create_model

from pcsr.errors import UserError, did_you_mean
from pcsr.recipe.section import PartSpec
from pcsr.validation_messages import LONGEST, shortened

UNSUITABLE = ("Optimizer", "LBFGS", "Muon", "SparseAdam")
"""Classes of `torch.optim` that are not offered: they need a closure, or weights or gradients of a certain form."""
OPTIMIZERS: dict[str, type[Any]] = {
    name.lower(): thing
    for name, thing in vars(torch.optim).items()
    if isinstance(thing, type) and issubclass(thing, torch.optim.Optimizer) and name not in UNSUITABLE
}
"""Optimizers by the names that recipes use."""
HOST = ("self", "params", "lr", "foreach", "fused", "capturable", "differentiable", "maximize")
"""Parameters of their constructors that are not options in a recipe."""


def optimizer_options(name: str) -> type[BaseModel]:
    """Return the model of an optimizer's options. Their types are those of torch's defaults.

    Raises:
        UserError: there is no such optimizer.
    """
    if name not in OPTIMIZERS:
        meant = did_you_mean(name[:LONGEST].lower(), OPTIMIZERS)
        raise UserError(f"there is no optimizer '{shortened(name)}': {meant}")
    parameters = inspect.signature(OPTIMIZERS[name].__init__).parameters
    fields: dict[str, Any] = {
        option: (_type(parameter.default), parameter.default)
        for option, parameter in parameters.items()
        if option not in HOST
    }
    return create_model(name, __config__=ConfigDict(extra="forbid", strict=True, allow_inf_nan=False), **fields)


def _type(default: Any) -> Any:
    """Return the type of an option with this default. Whole numbers are defaults of real ones in torch."""
    if isinstance(default, tuple):
        return tuple[tuple(_type(one) for one in default)]  # type: ignore[misc]  # known at run time alone
    if default is None:
        return float | None
    return bool if isinstance(default, bool) else float


def optimizer_mistake(optimizer: PartSpec) -> str | None:
    """Return why torch refuses the options of an optimizer, such as a negative momentum; None if it does not."""
    weight = torch.zeros(1, requires_grad=True)
    weight.grad = torch.ones(1)
    try:
        OPTIMIZERS[optimizer.use]([weight], lr=1e-3, **optimizer.options).step()
    except (TypeError, ValueError, RuntimeError, ArithmeticError) as error:  # some are refused by the first step alone
        text = str(error)
        return f"{optimizer.use} refuses its options: {text[:1].lower()}{text[1:]}: change them"
    return None
