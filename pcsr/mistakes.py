"""Mistakes that pydantic finds in what people write, as a person is told them."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

LONGEST = 80
"""Characters of a value in a message."""


def in_words(error: "ErrorDetails", path: str) -> str:
    """One mistake: where it is, what is wrong there, and the value.

    Args:
        error: one of `ValidationError.errors()`.
        path: the keys that lead to the value, joined by dots; empty for the whole.
    """
    if error["type"] == "missing":
        return f"{path} is missing: add it"
    said = error["msg"].removeprefix("Value error, ")
    said = said[0].lower() + said[1:]
    whole = isinstance(error["input"], dict) or error["type"] == "json_invalid"  # nobody looks for it in there
    got = "" if whole else f", got {shown(error['input'])}"
    return f"{path}: {said}{got}" if path else f"{said}{got}"


def shown(value: object) -> str:
    """A value as a message shows it: cut where it is long."""
    text = value if isinstance(value, str) else repr(value)
    text = repr(text[: LONGEST + 1]) if isinstance(value, str) else text
    return text if len(text) <= LONGEST else f"{text[:LONGEST]} …"
