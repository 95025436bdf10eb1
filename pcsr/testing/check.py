"""One check, and what comes of it."""

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal
from unittest import SkipTest

from pcsr.threads import threads


class CheckFailed(AssertionError):  # noqa: N818 it is an outcome, as Skipped is
    """A part does not keep its contract. The message names the part, what was found, what is expected, the remedy.

    Examples:
        >>> issubclass(pcsr.testing.CheckFailed, AssertionError)
        True
    """


class Skipped(SkipTest):
    """A check that says nothing about this part; the message says why. pytest reports it as skipped.

    Examples:
        >>> import unittest
        >>> issubclass(pcsr.testing.Skipped, unittest.SkipTest)
        True
    """


@dataclass(frozen=True)
class Outcome:
    """What came of a check.

    Examples:
        >>> pcsr.testing.Check("nothing", lambda: None).outcome()
        Outcome(check='nothing', result='passed', said='')
    """

    check: str
    result: Literal["passed", "failed", "skipped"]
    said: str = ""
    """Why, where it did not pass."""


@dataclass(frozen=True)
class Check:
    """A named check of one part. To be called; it returns where the part passes, and raises otherwise.

    Examples:
        >>> def run():
        ...     raise pcsr.testing.CheckFailed("three channels were expected, got 4: return three")
        >>> pcsr.testing.Check("channels", run).outcome().result
        'failed'
    """

    name: str
    run: Callable[[], None]

    def __call__(self) -> None:
        """Run it.

        Raises:
            CheckFailed: the part fails it.
            Skipped: it does not apply to this part.
        """
        with threads(1):  # its networks are small
            self.run()

    def __str__(self) -> str:
        """Its name, which pytest makes a test's id of."""
        return self.name

    def outcome(self) -> Outcome:
        """Run it, and tell what came of it instead of raising."""
        try:
            self()
        except CheckFailed as error:
            return Outcome(self.name, "failed", str(error))
        except Skipped as reason:
            return Outcome(self.name, "skipped", str(reason))
        return Outcome(self.name, "passed")


def said(error: BaseException) -> str:
    """An error that a part raised, in one line, with the place where it arose."""
    lines = " ".join(str(error).split())
    described = f"{type(error).__name__}: {lines}" if lines else type(error).__name__
    frames = traceback.extract_tb(error.__traceback__)
    return f"{described} (at {frames[-1].filename}:{frames[-1].lineno})" if frames else described
