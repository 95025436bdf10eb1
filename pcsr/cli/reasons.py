"""Reasons why objects or touches are left out, grouped by kind for the terminal."""

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

import click

from pcsr.errors import printable

if TYPE_CHECKING:
    from pcsr.recorded import Recording

MOST_ALIKE = 3
"""Most touches with reasons of one kind that are named one by one."""


def kinds(reasons: Mapping[str, str]) -> list[dict[str, str]]:
    """Group reasons that differ in names and numbers only.

    Args:
        reasons: reason for each name.

    Returns:
        The reasons of each kind by name, in the order of the first of a kind.
    """
    found: dict[str, dict[str, str]] = {}
    for name, reason in reasons.items():
        kind = re.sub(r"\d[\d.,e+-]*", "…", reason.replace(name, "…"))
        found.setdefault(kind, {})[name] = reason
    return list(found.values())


def skipped_lines(recording: "Recording") -> list[str]:
    """Return a line for each skipped touch; of many of one kind the first is named, and the others are counted.

    Args:
        recording: the recording.
    """
    lines = []
    for alike in kinds(recording.skipped):
        listed = list(alike.items())
        if len(listed) > MOST_ALIKE:
            name, reason = listed[0]
            lines.append(f"touch {name} and {len(listed) - 1} more like it are skipped: {reason}")
        else:
            lines += [f"touch {name} is skipped: {reason}" for name, reason in listed]
    return [printable(line, lines=False) for line in lines]


def echo_skipped(recording: "Recording") -> None:
    """Print the skipped touches and the reasons to standard error, also with `--quiet`."""
    for line in skipped_lines(recording):
        click.echo(line, err=True)
