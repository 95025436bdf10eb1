"""The part under test: its kind, its options, and instances of it."""

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
from pcsr.testing.check import Check, CheckFailed, Skipped, said

WIDTHS = (
    Widths(visual=32, touch=12, refined=48, rate=4),
    Widths(visual=128, touch=32, refined=256, rate=16),
    Widths(visual=64, touch=3, refined=130, rate=2),
    Widths(visual=37, touch=5, refined=51, rate=3),
)
"""Those that a network part is built for. It may refuse some; the first that it takes serves most checks."""
NETWORK = ("encoder", "fusion", "backbone", "upsampler")
"""Kinds that the host hands `Widths` to."""
GIVE = "checks_for(Part, option=…), or pcsr plugins check NAME --set option=…"
"""How the suite is told options."""
SHAKE = 0.05
"""Standard deviation of what is added to each weight of a lively instance."""


@dataclass(frozen=True)
class Subject:
    """A part and what every check needs to know of it."""

    part: type[Any]
    kind: str
    options: Mapping[str, Any]
    item: ShapeItem | None = None
    """The object that a touch source is to touch; None: the suite's own."""
    upsampler: type[Upsampler] | None = None
    """What an objective judges the network of; None: the suite's own."""

    def __str__(self) -> str:
        """How messages call it."""
        return f"{self.kind} {self.part.__name__}"

    def failure(self, found: str, expected: str, remedy: str) -> CheckFailed:
        """The error of a failed check, to be raised."""
        return CheckFailed(f"{self}: {found}; expected is {expected}: {remedy}")

    def check(self, name: str, run: Callable[["Subject"], None]) -> Check:
        """A check of this part: with random numbers of its own, and whatever the part may raise told as a failure."""

        def guarded() -> None:
            try:
                with torch.random.fork_rng(devices=[]), watched() as changes:
                    torch.manual_seed(0)
                    run(self)
            except (CheckFailed, Skipped):
                raise
            except (Exception, SystemExit) as error:
                raise self.failure(
                    f"it raised {said(error)}", f"that the check '{name}' runs through", "see where the error arose"
                ) from error
            if changes:
                raise self.failure(
                    f"it changed {' and '.join(changes)}",
                    "that a part leaves the process around it as it is",
                    "hand the dtype, the device and the like to each function that takes them",
                )

        return Check(name, guarded)

    def make(self, widths: Widths = WIDTHS[0], seed: int = 0) -> Any:
        """An instance, its weights drawn from a seed; whatever its constructor raises comes through."""
        host = (widths,) if self.kind in NETWORK else ()
        with seeded(seed):
            return self.part(*host, **self.options)

    @cached_property
    def widths(self) -> Widths:
        """The first of `WIDTHS` that the part can be built for.

        Raises:
            Skipped: there is none, which is for the check `builds` to tell.
        """
        for widths in WIDTHS:
            try:
                self.make(widths)
            except Exception:
                continue
            return widths
        raise Skipped(f"{self} cannot be built: see the check 'builds'")

    def built(self, seed: int = 0) -> Any:
        """An instance for `widths`, in `eval` mode where it is a module.

        Raises:
            Skipped: it cannot be built.
        """
        made = self.make(self.widths, seed)
        return made.eval() if isinstance(made, nn.Module) else made

    def lively(self, seed: int = 0) -> nn.Module:
        """An instance in double precision with weights a little off those it starts with.

        A layer that starts at zero hides whatever comes before it.
        """
        module = cast(nn.Module, self.built(seed)).double()
        with torch.no_grad(), seeded(seed + 1000):
            for weight in module.parameters():
                weight.add_(SHAKE * torch.randn_like(weight))
        return module

    def names_itself(self, error: UserError) -> bool:
        """Whether a refusal says who refuses: the kind, the class or the file."""
        known = (self.kind, self.part.__name__, self.part.__module__.rpartition(".")[2])
        return any(_plain(name) in _plain(str(error)) for name in known)

    def must_name_itself(self, error: UserError) -> None:
        """Fail for a refusal that leaves a person in the dark about who refuses.

        Raises:
            CheckFailed: it does.
        """
        if not self.names_itself(error):
            raise self.failure(
                f"it refuses with '{error}'",
                "that a refusal says which part refuses",
                f"begin the message with \"{self.kind} 'NAME' …\"",
            )


def kind_of(part: type[Any]) -> str:
    """The kind that a class is of.

    Raises:
        UserError: it is none.
    """
    for kind, name in KINDS.items():
        if isinstance(part, type) and issubclass(part, getattr(pcsr.contracts, name)):
            return kind
    names = ", ".join(f"pcsr.{name}" for name in KINDS.values())
    raise UserError(f"{part!r} is no part: give a class derived from one of {names}")


def channels(subject: Subject, module: Any) -> int:
    """What an encoder or backbone says of its width.

    Raises:
        CheckFailed: nothing, or nothing of use.
    """
    told = getattr(module, "channels", None)
    if not isinstance(told, int) or isinstance(told, bool) or told < 1:
        what = "features for each point" if isinstance(module, Encoder) else "features for the upsampler"
        raise subject.failure(
            f"its attribute `channels` is {told!r}",
            f"how many {what} it gives",
            "set self.channels in the constructor",
        )
    return told


@contextmanager
def seeded(seed: int) -> Iterator[None]:
    """Torch's random numbers from a seed, and back to where they were."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        yield


def pickled(thing: Any) -> Any:
    """What another process of the same program is handed."""
    return pickle.loads(pickle.dumps(thing))


def _plain(text: str) -> str:
    """Lower case letters and digits alone: `UpDownUp`, `up_down_up` and 'up-down-up' are one name."""
    return re.sub(r"[^a-z0-9]", "", text.lower())
