"""Standard input, output and error of a command, where one of them may be closed, full, or not of UTF-8."""

import io
import os
import sys
from contextlib import suppress
from typing import BinaryIO

from pcsr.errors import RunError, UserError

WIDTHS = range(20, 10_000)
"""Columns of a terminal that text and tables can be fitted into."""


def prepare() -> None:
    """Make the three streams usable, whatever the shell did with them.

    A closed one is opened onto nothing: the next file that is opened would take its number, and whatever a library
    prints would go into that file. What the encoding of a terminal lacks, such as ×, is written as an escape. A width
    of the terminal that nothing fits into is forgotten.
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
    """Standard input, to read bytes from.

    Raises:
        UserError: it is closed.
    """
    if sys.stdin is None:
        raise UserError("-: standard input is closed: name a file, or let a command write into the pipe")
    return sys.stdin.buffer


def open_output() -> None:
    """Refuse to compute what nobody could be given.

    Raises:
        UserError: standard output is closed.
    """
    if sys.__stdout__ is None:
        raise UserError("-o -: standard output is closed: name a file, or let a command read from the pipe")


def put(content: bytes) -> None:
    """Write bytes to standard output, all of them."""
    sys.stdout.buffer.write(content)
    sys.stdout.flush()


def flush() -> None:
    """Write what is still to be written to standard output.

    Raises:
        RunError: the disk is full; the rest is given up, so that the end of the process does not try again.
    """
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        give_up()
        raise RunError(f"standard output cannot be written: {error.strerror}") from error


def give_up() -> None:
    """Forget what could not be written to the streams: the end of the process would try again, and complain."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except OSError:
            with suppress(OSError):  # a stream of a test has no number
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
