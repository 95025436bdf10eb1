"""The part that is tested: its kind, its options, and its instances."""

import pickle  # noqa: TID251 for what workers are handed, not for files
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import torch
from torch import nn

import pcsr.contracts
from pcsr.contracts import Encoder, ShapeItem, Upsampler, Widths
from pcsr.errors import UserError
from pcsr.plugins.guard import watched
from pcsr.plugins.registry import KINDS
from pcsr.testing.check import Check, CheckFailed, Skipped, describe

WIDTHS = (
    Widths(visual=32, touch=12, refined=48, rate=4),
    Widths(visual=128, touch=32, refined=256, rate=16),
    Widths(visual=64, touch=3, refined=130, rate=2),
    Widths(visual=37, touch=5, refined=51, rate=3),
)
"""Widths for which a network part is built. It may refuse some; most checks use the first that it accepts."""
NETWORK = ("encoder", "fusion", "backbone", "upsampler")
"""Kinds of part whose constructor takes `Widths`."""
GIVE = "checks_for(Part, option=…), or pcsr plugins check NAME --set option=…"
"""How options are given to the suite, in messages."""
SHAKE = 0.05
"""Standard deviation of the perturbation of the weights in `Subject.perturbed`."""


@dataclass(frozen=True)
class Subject:
    """A part and the inputs of its checks."""

    part: type[Any]
    kind: str
    options: Mapping[str, Any]
    item: ShapeItem | None = None
    """Object for a touch source; None: the suite's own."""
    upsampler: type[Upsampler] | None = None
    """Upsampler of the network for an objective; None: the suite's own."""

    def __str__(self) -> str:
        """Return the name of the part in messages."""
        return f"{self.kind} {self.part.__name__}"

    def failure(self, found: str, expected: str, remedy: str) -> CheckFailed:
        """Create the error of a failed check."""
        return CheckFailed(f"{self}: {found}; expected is {expected}: {remedy}")

    def check(self, name: str, run: Callable[["Subject"], None]) -> Check:
        """Create a check of this part. It has a seed of its own, and any error that the part raises is a failure."""

        def guarded() -> None:
            try:
                with torch.random.fork_rng(devices=[]), watched() as changes:
                    torch.manual_seed(0)
                    run(self)
            except (CheckFailed, Skipped):
                raise
            except (Exception, SystemExit) as error:
                raise self.failure(
                    f"it raised {describe(error)}",
                    f"that the check '{name}' runs through",
                    "see where the error arose",
                ) from error
            if changes:
                raise self.failure(
                    f"it changed {' and '.join(changes)}",
                    "that a part leaves the process around it as it is",
                    "pass the dtype, the device and the like to each function that takes them",
                )

        return Check(name, guarded)

    def make(self, widths: Widths = WIDTHS[0], seed: int = 0) -> Any:
        """Build an instance with weights from a seed. Errors of the constructor are not caught."""
        host = (widths,) if self.kind in NETWORK else ()
        with seeded(seed):
            return self.part(*host, **self.options)

    @cached_property
    def widths(self) -> Widths:
        """First of `WIDTHS` for which the part can be built.

        Raises:
            Skipped: there is none; the check `builds` then fails.
        """
        for widths in WIDTHS:
            try:
                self.make(widths)
            except Exception:
                continue
            return widths
        raise Skipped(f"{self} cannot be built: see the check 'builds'")

    def built(self, seed: int = 0) -> Any:
        """Build an instance for `widths`, in `eval` mode if it is a module.

        Raises:
            Skipped: it cannot be built.
        """
        instance = self.make(self.widths, seed)
        return instance.eval() if isinstance(instance, nn.Module) else instance

    def perturbed(self, seed: int = 0) -> nn.Module:
        """Build an instance in double precision with perturbed weights.

        A layer whose weights are initially zero would hide mistakes in the layers before it.
        """
        module = cast(nn.Module, self.built(seed)).double()
        with torch.no_grad(), seeded(seed + 1000):
            for weight in module.parameters():
                weight.add_(SHAKE * torch.randn_like(weight))
        return module

    def names_itself(self, error: UserError) -> bool:
        """Whether the message of an error names the part: by its kind, its class or its file."""
        known = (self.kind, self.part.__name__, self.part.__module__.rpartition(".")[2])
        return any(_plain(name) in _plain(str(error)) for name in known)

    def must_name_itself(self, error: UserError) -> None:
        """Fail if the message of an error does not name the part.

        Raises:
            CheckFailed: it does not.
        """
        if not self.names_itself(error):
            raise self.failure(
                f"it refuses with '{error}'",
                "that the message names the part",
                f"begin the message with \"{self.kind} 'NAME' …\"",
            )


def kind_of(part: type[Any]) -> str:
    """Kind of a part's class.

    Raises:
        UserError: the class is not a part.
    """
    for kind, name in KINDS.items():
        if isinstance(part, type) and issubclass(part, getattr(pcsr.contracts, name)):
            return kind
    names = ", ".join(f"pcsr.{name}" for name in KINDS.values())
    raise UserError(f"{part!r} is no part: give a class derived from one of {names}")


def channels(subject: Subject, module: Any) -> int:
    """Number of output channels that an encoder or backbone declares.

    Raises:
        CheckFailed: it declares none, or not a number.
    """
    declared = getattr(module, "channels", None)
    if not isinstance(declared, int) or isinstance(declared, bool) or declared < 1:
        what = "features of each point" if isinstance(module, Encoder) else "features for the upsampler"
        raise subject.failure(
            f"its attribute `channels` is {declared!r}",
            f"the number of {what}",
            "set self.channels in the constructor",
        )
    return declared


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Seed torch's random numbers, and restore their state afterwards."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        yield


def pickled(thing: Any) -> Any:
    """Copy an object by pickling it, as it is sent to another process."""
    return pickle.loads(pickle.dumps(thing))


def _plain(text: str) -> str:
    """Reduce a name to lower case letters and digits: `UpDownUp`, `up_down_up` and 'up-down-up' are equal."""
    return re.sub(r"[^a-z0-9]", "", text.lower())
