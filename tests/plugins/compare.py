"""A part beside its slow form: values, and gradients in either precision."""

from collections.abc import Callable, Sequence

import torch
from torch import nn

from tests.plugins.plain import plain

LONGEST = 2048
"""Terms of the longest sum in the gradients of the parts below: points of a batch, or channels times neighbours."""
TIED = 1e-4
"""Values that are closer than this may change their order in single precision."""


def close(a: torch.Tensor, b: torch.Tensor, atol: float = 1e-5) -> None:
    torch.testing.assert_close(a, b, atol=atol, rtol=0)


def same_gradients(fast: torch.Tensor, slow: torch.Tensor, wanted: Sequence[torch.Tensor], **tolerance: float) -> None:
    """Two results of one value have the same gradients by each of some tensors."""
    towards = torch.randn_like(slow)
    for a, b in zip(*(torch.autograd.grad(y, wanted, towards) for y in (fast, slow)), strict=True):
        torch.testing.assert_close(a, b, **tolerance)


def check_single_precision(part: nn.Module, call: Callable[[nn.Module], torch.Tensor], towards: torch.Tensor) -> None:
    """Gradients of a part in single precision beside those of its plain twin in double.

    A sum of n terms is off by at most n roundings (Higham, "Accuracy and Stability of Numerical Algorithms", Sec. 4.2).
    """

    def gradients(one: nn.Module) -> tuple[torch.Tensor, ...]:
        output = call(one)
        return torch.autograd.grad((output * towards.to(output.dtype)).sum(), list(one.parameters()))

    for (name, _), ours, wanted in zip(
        part.named_parameters(), gradients(part), gradients(plain(part).double()), strict=True
    ):
        if name != "key.bias":  # softmax does not depend on it: its gradient is rounding alone
            off = (ours.double() - wanted).norm() / wanted.norm()
            assert off <= LONGEST * torch.finfo(torch.float32).eps, (name, off)


def like(part: nn.Module, tensor: torch.Tensor) -> torch.Tensor:
    """A tensor in the precision of a part's weights."""
    return tensor.to(next(part.parameters()).dtype)
