"""Checks of reproducibility: with one seed, from a file of weights, and as an exported graph."""

import logging
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import Any, cast

import torch
from safetensors.torch import load_file
from torch import Tensor, nn

from pcsr.errors import RunError
from pcsr.files import save_tensors
from pcsr.testing.behaviour import CLOSE
from pcsr.testing.check import Skipped
from pcsr.testing.inputs import FEW, apart, call, given, takes
from pcsr.testing.objectives import judged
from pcsr.testing.subject import Subject, seeded


def result(subject: Subject, module: nn.Module) -> Tensor:
    """Output of a part of any kind for the suite's input, without gradients."""
    if subject.kind == "objective":
        with torch.no_grad():
            return judged(subject, module)
    with torch.no_grad():
        return call(module, subject.widths.rate, given(module, subject.widths, batch=2, count=FEW))


def deterministic(subject: Subject) -> None:
    """Initial weights and training depend on torch's seed alone; in `eval` mode nothing is random."""
    first, second = subject.perturbed(), subject.perturbed()
    for name, weight in first.state_dict().items():
        if not torch.equal(weight, second.state_dict()[name]):
            raise subject.failure(
                f"two instances of one seed differ in '{name}'",
                "that torch's seed decides the weights",
                "draw them with torch's generator alone",
            )
    once, again = result(subject, first), result(subject, first)
    if not torch.equal(once, again):
        raise subject.failure(
            f"in eval mode the same input gives results that are {apart(once, again):.2g} apart",
            "one result",
            "draw nothing at random, and keep no state, where `self.training` is False",
        )
    runs = []
    for module in (first, second):
        with seeded(1):
            runs.append(result(subject, module.train()))
    if not torch.equal(*runs):
        raise subject.failure(
            f"in training one seed gives results that are {apart(*runs):.2g} apart",
            "that torch's seed decides all that is random",
            "draw with torch's generator alone",
        )


def weights(subject: Subject) -> None:
    """`state_dict` determines the output, and can be written to a safetensors file and read again."""
    module = subject.perturbed()
    tensors = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "weights.safetensors"
        try:
            save_tensors(path, module.state_dict(), {})
        except (RunError, RuntimeError, ValueError) as error:
            raise subject.failure(
                f"its weights cannot be written: {' '.join(str(error).split())}",
                "weights that a safetensors file can hold",
                "let no two names of the state be one tensor, and keep tensors alone in it",
            ) from error
        if module.state_dict():
            tensors = load_file(path)
    other = cast(nn.Module, subject.built(seed=1)).double()
    try:
        other.load_state_dict(tensors)
    except RuntimeError as error:
        raise subject.failure(
            f"an instance of another seed does not take its weights: {' '.join(str(error).split())}",
            "that options and widths alone decide the names and shapes of the weights",
            "make them of one shape",
        ) from error
    gap = apart(result(subject, other), result(subject, module))
    if gap:
        raise subject.failure(
            f"with its weights another instance gives a result that is {gap:.2g} off",
            "the same result",
            "keep all that is drawn or learned in parameters and buffers (nn.Parameter, register_buffer)",
        )


class _Called(nn.Module):
    """A module whose arguments are tensors alone, as `torch.export` needs it."""

    def __init__(self, subject: Subject, module: nn.Module) -> None:
        super().__init__()
        self.module = module.requires_grad_(False)
        self.rate = subject.widths.rate
        self.names = takes(module)

    def forward(self, *tensors: Tensor) -> Tensor:
        """Return the part's output."""
        return call(self.module, self.rate, dict(zip(self.names, tensors, strict=True)))


def export(subject: Subject) -> None:
    """The part can be exported by `torch.export` for batches of any size, with the same output."""
    called = _Called(subject, subject.perturbed())
    example = tuple(given(called.module, subject.widths, batch=2, count=FEW).values())
    graph, error = _graph(called, example, dynamic=True)
    if graph is None:
        fixed, _ = _graph(called, example, dynamic=False)
        if fixed is None:
            raise Skipped(f"{subject} cannot be exported: {error}")
        raise subject.failure(
            f"its graph takes batches of one size alone: {error}",
            "batches of any size",
            "write x.shape[0] for its size, not len(x) or a number, and loop over no batch",
        )
    for batch in (1, 3):
        tensors = tuple(given(called.module, subject.widths, batch=batch, count=FEW, seed=5).values())
        with torch.no_grad():
            gap = apart(graph(*tensors), called(*tensors))
        if gap > CLOSE:
            raise subject.failure(
                f"for a batch of {batch} its exported graph is {gap:.2g} off",
                "the same result",
                "look at branches on values and on torch.compiler.is_exporting",
            )


def _graph(called: nn.Module, example: tuple[Tensor, ...], *, dynamic: bool) -> tuple[Any, str]:
    """The graph, or None and the reason."""
    sizes = (tuple({0: torch.export.Dim("batch", min=1, max=1024)} for _ in example),) if dynamic else None
    try:
        with _quiet(), torch.no_grad():
            return torch.export.export(called, example, dynamic_shapes=sizes, strict=False).module(), ""
    except Exception as error:  # whatever a part and the exporter may say
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        return None, f"{type(error).__name__}: {lines[0]}" if lines else type(error).__name__


@contextmanager
def _quiet() -> Iterator[None]:
    """Silence the messages of the exporter."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings(), redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        logging.disable(before)
