"""Standard input, output and error of a command, any of which may be closed, full, or not UTF-8."""

import io
import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, BinaryIO

from pcsr.errors import RunError, UserError, printable

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from rich.console import Console

WIDTHS = range(20, 10_000)
"""Widths of a terminal, in columns, that text and tables are fitted to."""

UNLIMITED = 100_000
"""Width of a file or pipe, in columns: more than any table has, so that tables there have their own width."""


def console(*, error: bool = False, quiet: bool = False) -> "Console":
    """Return a console on standard output, on which every command prints its tables and messages.

    On a terminal it has the terminal's width. In a file or a pipe it wraps and cuts nothing, and has no colours.

    Args:
        error: print to standard error instead.
        quiet: print nothing.
    """
    from rich.console import Console

    terminal = (sys.stderr if error else sys.stdout).isatty()
    return Console(
        stderr=error,
        quiet=quiet,
        width=None if terminal else UNLIMITED,
        force_terminal=None if terminal else False,  # whatever FORCE_COLOR says, a file gets no bars
    )


def print_table(
    console: "Console",
    heads: "Sequence[str]",
    rows: "Sequence[Sequence[str]]",
    numbers: "Collection[str]" = (),
    caption: str | None = None,
) -> None:
    """Print a table without a frame.

    Args:
        console: console to print on.
        heads: head of each column.
        rows: cells of each row.
        numbers: heads of the columns that are aligned to the right.
        caption: line below the table.
    """
    from rich import box
    from rich.table import Column, Table
    from rich.text import Text

    columns = (Column(head, overflow="fold", justify="right" if head in numbers else "left") for head in heads)
    table = Table(
        *columns, box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, collapse_padding=True, caption=caption
    )
    table.caption_justify = "left"
    for row in rows:
        table.add_row(*(Text(printable(cell, lines=False)) for cell in row))
    console.print(table)


def prepare() -> None:
    """Make the three standard streams usable, whatever state the shell left them in.

    A closed stream is opened onto the null device; otherwise the next opened file would get its descriptor, and
    receive what libraries print. Characters that the terminal's encoding lacks, such as ×, are written as escapes.
    A `COLUMNS` outside `WIDTHS` is ignored.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.dup2(os.open(os.devnull, os.O_RDWR), number)
            os.set_inheritable(number, True)
    if sys.stdout is None:
        sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115 it stays open
    if sys.stderr is None:
        sys.stderr = open(2, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    columns = os.environ.get("COLUMNS", "")
    if columns.isdecimal() and not (len(columns) < 6 and int(columns) in WIDTHS):
        del os.environ["COLUMNS"]
    if isinstance(sys.stdout, io.TextIOWrapper) and sys.stdout.errors == "strict":
        sys.stdout.reconfigure(errors="backslashreplace")


def open_input() -> BinaryIO:
    """Return standard input as a binary stream.

    Raises:
        UserError: standard input is closed.
    """
    if sys.stdin is None:
        raise UserError("-: standard input is closed: name a file, or let another command write to the pipe")
    return sys.stdin.buffer


def open_output() -> None:
    """Check that standard output is open, before work whose result goes there.

    Raises:
        UserError: standard output is closed.
    """
    if sys.__stdout__ is None:
        raise UserError("-o -: standard output is closed: name a file, or let another command read from the pipe")


def put(content: bytes) -> None:
    """Write bytes to standard output and flush it."""
    sys.stdout.buffer.write(content)
    sys.stdout.flush()


def flush() -> None:
    """Flush standard output.

    Raises:
        RunError: it cannot be written, for example because the disk is full. What is buffered is then discarded.
    """
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        give_up()
        raise RunError(f"standard output cannot be written: {error.strerror}") from error


def give_up() -> None:
    """Discard what the streams could not write; otherwise the process would try again at its end, and complain."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            with suppress(OSError):  # a test's stream has no file descriptor
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
