"""What pydantic finds wrong with a value, in one clause: what it must be, and what it is."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from reprlib import Repr
from typing import Any

LONGEST = 80
"""Characters of a value that a message shows."""
_repr = Repr()
"""Writes a value without going into all of it: written out in full, lists in lists may never end."""
_repr.maxlevel = 4
_repr.maxlist = _repr.maxtuple = _repr.maxdict = _repr.maxset = 32
_repr.maxstring = _repr.maxlong = _repr.maxother = 2 * LONGEST

Context = Mapping[str, Any]


def shortened(text: str, longest: int = LONGEST) -> str:
    """A text, cut where it is long."""
    return text if len(text) <= longest else f"{text[:longest]}…"


def shown(value: Any) -> str:
    """A value as Python writes it, shortened where it is long.

    Args:
        value: anything; an integer of a million digits and a list that holds itself too.
    """
    if isinstance(value, str):
        return shortened(repr(value[: 2 * LONGEST]))
    if isinstance(value, int) and value.bit_length() > 4 * LONGEST:  # Python refuses to write very long ones
        return f"a number of about {round(value.bit_length() * 0.30103)} digits"
    try:
        return shortened(_repr.repr(value))
    except (ValueError, RecursionError, MemoryError):
        return f"a {type(value).__name__}"


def shown_path(path: Path) -> str:
    """A path as it is; of one that no file can have, too long or with a control character, its beginning."""
    text = str(path)
    return text if text.isprintable() and len(text) < 4096 and len(path.name) < 256 else shown(text)


def explained(errors: Sequence[Mapping[str, Any]]) -> str:
    """What a value must be and what it is: "it must be 1 or more, got -3".

    Args:
        errors: of `pydantic.ValidationError.errors()`, all about one value: more than one where it failed each branch
            of a union.
    """
    clauses = list(dict.fromkeys(map(_clause, errors)))
    wanted = [clause.removeprefix(MUST) for clause in clauses if clause.startswith(MUST)]
    said = [clause for clause in clauses if not clause.startswith(MUST)]
    if wanted:
        said.insert(0, MUST + " or ".join(wanted))
    value = errors[0]["input"]
    text = "; ".join(said)
    # A whole section says nothing of what a validator found in it, and a validator may name the value itself.
    known = (isinstance(value, str) and shown(value) in text) or (isinstance(value, Mapping) and not wanted)
    return text if known else f"{text}, got {shown(value)}"


MUST = "it must be "


def _clause(error: Mapping[str, Any]) -> str:
    kind, context = error["type"], error.get("ctx", {})
    if kind in WANTED:
        return MUST + WANTED[kind](context)
    # A validator's own words; of a kind that no schema of ours has, what the library says is better than nothing.
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
"""What a value that meets each of pydantic's errors must be; a new kind of constraint gets its line here."""
