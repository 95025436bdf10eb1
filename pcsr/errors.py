"""Errors and warnings of pcsr. A message names the thing, its value, its place and the remedy.

The command line prints the message without a traceback and exits with the error's code; `--traceback` prints both.
"""

from collections.abc import Iterable
from difflib import get_close_matches


class PcsrError(Exception):
    """Base class of the errors that pcsr raises."""

    exit_code = 1
    """Exit code of the command line."""

    placed = False
    """Whether each line of the message begins with a position in a file, which editors and terminals show as a link."""

    def __str__(self) -> str:
        """Return the message; control characters, which names in it may contain, are written as escapes."""
        letters = super().__str__()
        return "".join(one if one.isprintable() or one == "\n" else ascii(one)[1:-1] for one in letters)


class UserError(PcsrError):
    """Error in the user's input: a recipe, a file, an option."""

    exit_code = 2


class RunError(PcsrError):
    """Failure of a run with valid input, such as a full disk or a loss that is not finite."""


class PcsrWarning(UserWarning):
    """Warning of pcsr. The command line shows these warnings and no other library's."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Suggest a known name for an unknown one: the closest, or all of them if none is close.

    Args:
        name: the unknown name.
        known: all known names.

    Returns:
        Text that continues an error message after a colon, such as ``did you mean 'iterative'?``.
    """
    names = sorted(known)
    close = get_close_matches(name, names, n=1)
    if close:
        return f"did you mean '{close[0]}'?"
    return f"known: {', '.join(names)}" if names else "none is known"
