"""A check of a part, and its outcome."""

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal
from unittest import SkipTest

from pcsr.threads import threads


class CheckFailed(AssertionError):  # noqa: N818 it is an outcome, as Skipped is
    """A part breaks its contract. The message names the part, what was found, what is expected, and the remedy.

    Examples:
        >>> issubclass(pcsr.testing.CheckFailed, AssertionError)
        True
    """


class Skipped(SkipTest):
    """A check does not apply to a part; the message says why. pytest reports it as skipped.

    Examples:
        >>> import unittest
        >>> issubclass(pcsr.testing.Skipped, unittest.SkipTest)
        True
    """


@dataclass(frozen=True)
class Outcome:
    """The outcome of a check.

    Examples:
        >>> pcsr.testing.Check("nothing", lambda: None).outcome()
        Outcome(check='nothing', result='passed', reason='')
    """

    check: str
    result: Literal["passed", "failed", "skipped"]
    reason: str = ""
    """Why it did not pass; empty if it did."""


@dataclass(frozen=True)
class Check:
    """A named check of one part. Calling it raises an error unless the part passes.

    Examples:
        >>> def positive():
        ...     if not 1 > 0:
        ...         raise pcsr.testing.CheckFailed("expected a positive number")
        >>> check = pcsr.testing.Check("positive", positive)
        >>> check()
        >>> check.outcome().result
        'passed'
    """

    name: str
    run: Callable[[], None]

    def __call__(self) -> None:
        """Run the check.

        Raises:
            CheckFailed: the part breaks its contract.
            Skipped: the check does not apply to the part.
        """
        with threads(1):  # the networks of the suite are small
            self.run()

    def __str__(self) -> str:
        """Return the name, which pytest uses as the id of a test."""
        return self.name

    def outcome(self) -> Outcome:
        """Run the check and return its outcome instead of raising."""
        try:
            self()
        except CheckFailed as error:
            return Outcome(self.name, "failed", str(error))
        except Skipped as reason:
            return Outcome(self.name, "skipped", str(reason))
        return Outcome(self.name, "passed")


def describe(error: BaseException) -> str:
    """Describe an error that a part raised in one line, with the file and line where it arose."""
    lines = " ".join(str(error).split())
    message = f"{type(error).__name__}: {lines}" if lines else type(error).__name__
    frames = traceback.extract_tb(error.__traceback__)
    return f"{message} (at {frames[-1].filename}:{frames[-1].lineno})" if frames else message
