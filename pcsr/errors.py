"""The errors a person sees: one line that names the thing, its value, its place and the remedy.

The command line prints the message alone and exits with the error's code; `--traceback` shows the rest.
"""

from collections.abc import Iterable
from difflib import get_close_matches


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

    placed = False
    """Whether each line of the message begins with a place in a file, which editors and terminals make a link."""

    def __str__(self) -> str:
        """The message. Characters that steer a terminal are written as escapes: names in it may hold them."""
        letters = super().__str__()
        return "".join(one if one.isprintable() or one == "\n" else ascii(one)[1:-1] for one in letters)


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


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A remedy for an unknown name: the closest known one, or all of them.

    Returns:
        Text to put after "…: ", for example ``did you mean 'iterative'?``.
    """
    names = sorted(known)
    close = get_close_matches(name, names, n=1)
    if close:
        return f"did you mean '{close[0]}'?"
    return f"known: {', '.join(names)}" if names else "none is known"
