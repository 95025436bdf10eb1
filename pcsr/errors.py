"""Errors and warnings of pcsr. A message names the thing, its value, its place and the remedy.

The command line prints the message without a traceback and exits with the error's code; `--traceback` prints both.
"""

from collections.abc import Iterable
from difflib import get_close_matches


def printable(text: str, *, lines: bool = True) -> str:
    """Return text with its control characters and broken letters as escapes, as names in files may contain them.

    Args:
        text: the text.
        lines: keep line feeds, which are written as escapes otherwise.
    """
    return "".join(one if one.isprintable() or (lines and one == "\n") else ascii(one)[1:-1] for one in text)


class PcsrError(Exception):
    """Anything that pcsr itself reports. `exit_code` is what the command line returns.

    Examples:
        >>> try:
        ...     pcsr.load("no-such-model")
        ... except pcsr.PcsrError as error:
        ...     print(error.exit_code)
        2
    """

    exit_code = 1
    """Exit code of the command line."""

    placed = False
    """Whether each line of the message begins with a position in a file, which editors and terminals show as a link."""

    def __str__(self) -> str:
        """Return the message; control characters, which names in it may contain, are written as escapes."""
        return printable(super().__str__())


class UserError(PcsrError):
    """A mistake in what a person gave us: a recipe, a file, an option.

    Examples:
        >>> try:
        ...     pcsr.evaluate(np.eye(3), np.eye(3), metrics="chamfer")
        ... except pcsr.UserError as error:
        ...     print(error)
        there is no metric 'chamfer': known: cd, emd, hd, hd-pugcn, p2f
    """

    exit_code = 2


class RunError(PcsrError):
    """A run that could not finish through no mistake in its input: a full disk, a loss that is not finite.

    Examples:
        >>> pcsr.RunError("the disk is full").exit_code
        1
    """


class PcsrWarning(UserWarning):
    """A remark of pcsr's own. The command line shows these, and no other library's.

    Examples:
        >>> import warnings
        >>> warnings.simplefilter("ignore", pcsr.PcsrWarning)
    """

    def __str__(self) -> str:
        """Return the message; control characters, which names in it may contain, are written as escapes."""
        return printable(super().__str__())


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
