"""Messages for pydantic's validation errors, and values shortened for messages."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from reprlib import Repr
from typing import Any

from pcsr.errors import did_you_mean

LONGEST = 80
"""Most characters of a value in a message."""
_repr = Repr()
"""Formatter that stops early in long and nested values; a list may contain itself."""
_repr.maxlevel = 4
_repr.maxlist = _repr.maxtuple = _repr.maxdict = _repr.maxset = 32
_repr.maxstring = _repr.maxlong = _repr.maxother = 2 * LONGEST

Context = Mapping[str, Any]


def shortened(text: str, longest: int = LONGEST) -> str:
    """Cut a text to `longest` characters and an ellipsis."""
    return text if len(text) <= longest else f"{text[:longest]}…"


def shown(value: Any) -> str:
    """Return the `repr` of a value, shortened to `LONGEST` characters and an ellipsis.

    Args:
        value: any value, including huge integers and lists that contain themselves.
    """
    if isinstance(value, str):
        return shortened(repr(value[: 2 * LONGEST]))
    if isinstance(value, int) and value.bit_length() > 4 * LONGEST:  # Python refuses to format very long ones
        return f"a number of about {round(value.bit_length() * 0.30103)} digits"
    try:
        return shortened(_repr.repr(value))
    except (ValueError, RecursionError, MemoryError):
        return f"a {type(value).__name__}"


def shown_path(path: Path) -> str:
    """Return a path as text; one that is too long or has control characters is shortened and quoted."""
    text = str(path)
    return text if text.isprintable() and len(text) < 4096 and len(path.name) < 256 else shown(text)


def described(errors: Sequence[Mapping[str, Any]], path: str, owner: str, known: Iterable[str]) -> str:
    """Return the message for one location of plain data: "encoder 'net' takes no 'ordr': did you mean 'order'?".

    Args:
        errors: items of `pydantic.ValidationError.errors()`, all about this location.
        path: dotted keys of the location, such as "model.encoder".
        owner: name of the section or part that has the key, for messages.
        known: keys that the owner allows.
    """
    kind = errors[0]["type"]
    if kind == "extra_forbidden":
        key = str(errors[0]["loc"][-1])
        return f"{owner} takes no '{shown(key)[1:-1]}': {did_you_mean(key, known)}"
    if kind == "missing":
        return f"{path} is missing: add it"
    return f"{path}: {explained(errors)}"


def explained(errors: Sequence[Mapping[str, Any]]) -> str:
    """Return one message for the validation errors of one value, such as "it must be 1 or more, got -3".

    Args:
        errors: items of `pydantic.ValidationError.errors()`, all about the same value. A union gives an error for each
            of its branches.
    """
    clauses = list(dict.fromkeys(map(_clause, errors)))
    wanted = [clause.removeprefix(MUST) for clause in clauses if clause.startswith(MUST)]
    message = [clause for clause in clauses if not clause.startswith(MUST)]
    if wanted:
        message.insert(0, MUST + " or ".join(wanted))
    value = errors[0]["input"]
    # Messages of validators describe the mistake themselves: a whole section, or a value in them, is not repeated.
    text = "; ".join(message)
    named = not wanted and (isinstance(value, Mapping) or repr(value) in text)
    return text if named else f"{text}, got {shown(value)}"


MUST = "it must be "
"""Beginning of a message that states a requirement."""


def _clause(error: Mapping[str, Any]) -> str:
    kind, context = error["type"], error.get("ctx", {})
    if kind in WANTED:
        return MUST + WANTED[kind](context)
    # The message of a validator, or else pydantic's.
    text = str(context.get("error") or error["msg"])
    return text[:1].lower() + text[1:]


def _number(bound: int | float) -> str:
    return f"{bound:.12g}" if isinstance(bound, float) else str(bound)


def _items(count: int) -> str:
    return "1 item" if count == 1 else f"{count} items"


def _characters(count: int) -> str:
    return "1 character" if count == 1 else f"{count} characters"


WANTED: dict[str, Callable[[Context], str]] = {
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float", "int_parsing_size"), lambda _: "a whole number"),
    **dict.fromkeys(("float_type", "float_parsing"), lambda _: "a number"),
    "finite_number": lambda _: "a finite number",
    **dict.fromkeys(("bool_type", "bool_parsing"), lambda _: "true or false"),
    "string_type": lambda _: "text",
    "none_required": lambda _: "null",
    **dict.fromkeys(("list_type", "tuple_type", "set_type", "frozen_set_type"), lambda _: "a list"),
    **dict.fromkeys(("dict_type", "model_type", "model_attributes_type", "mapping_type"), lambda _: "a mapping"),
    "greater_than": lambda context: f"more than {_number(context['gt'])}",
    "greater_than_equal": lambda context: f"{_number(context['ge'])} or more",
    "less_than": lambda context: f"less than {_number(context['lt'])}",
    "less_than_equal": lambda context: f"at most {_number(context['le'])}",
    "multiple_of": lambda context: f"a multiple of {_number(context['multiple_of'])}",
    **dict.fromkeys(("literal_error", "enum"), lambda context: str(context["expected"])),
    "too_short": lambda context: f"a list of {_items(context['min_length'])} or more",
    "too_long": lambda context: f"a list of at most {_items(context['max_length'])}",
    "string_too_short": lambda context: f"text of {_characters(context['min_length'])} or more",
    "string_too_long": lambda context: f"text of at most {_characters(context['max_length'])}",
    "string_pattern_mismatch": lambda context: f"text that matches {context['pattern']}",
    "missing_argument": lambda _: "given",
}
"""Requirement that each of pydantic's error types stands for. A new kind of constraint needs an entry here."""
