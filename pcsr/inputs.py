"""Opening what a person names: a file of a bounded size, or a pipe into which somebody writes."""

import errno
import os
import select
import stat
from collections.abc import Callable
from io import FileIO
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from pcsr.errors import UserError
from pcsr.limits import FREELY, LARGEST_FILE, LARGEST_PIPE, LONGEST_LINE, check_memory, gigabytes
from pcsr.validation_messages import shown_path

HEAD = 2 * LONGEST_LINE
"""Bytes that are looked at before the rest is read."""
CHUNK = 1 << 20
PATIENCE = 10.0
"""Seconds that a named pipe may take to give its first byte."""
KINDS = {stat.S_IFDIR: "a folder", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device", stat.S_IFSOCK: "a socket"}
SOCKET = "it is a socket, not a file: name a file, or give its content through a pipe"


@runtime_checkable
class Readable(Protocol):
    """What bytes are read from."""

    def read(self, size: int, /) -> Any:
        """Some bytes, at most `size`; none at the end."""


def read_bytes(
    path: Path,
    *,
    most: int = LARGEST_FILE,
    memory: int | float = 1.0,
    check: Callable[[bytes], None] = lambda head: None,
) -> bytes:
    """The content of a file, or what comes through a pipe that has a name: `<(command)`, or one made by `mkfifo`.

    Nothing is read of what is neither, and only the beginning of what turns out to be something else.

    Args:
        path: of the file or pipe.
        most: bytes that it may have.
        memory: what it takes to make something of the content: so many times its size.
        check: looks at the first megabyte and refuses it with a `UserError`.

    Raises:
        UserError: there is no such file, it is a device, folder or socket, is too large, or changes while it is read;
            or nobody writes into the pipe.
    """
    with _opened(path) as file:
        about = os.fstat(file.fileno())
        if stat.S_ISFIFO(about.st_mode):
            _wait(file, path)
            return read_pipe(file, str(path), most=min(most, LARGEST_PIPE), memory=memory, check=check)
        size = about.st_size
        if size > most:
            raise UserError(
                f"{path} has {gigabytes(size)}, and {gigabytes(most)} are the most that is read of such a file"
            )
        check_memory(size * memory, f"{path} ({gigabytes(size)})")
        if size == 0:  # it is empty, or one of the system's, whose size nobody knows
            return read_pipe(file, str(path), most=most, memory=memory, check=check)
        try:
            if size > HEAD:
                check(file.read(HEAD))
                file.seek(0)
            data = file.read(size + 1)
        except OSError as error:
            raise UserError(f"{path} cannot be read: {error.strerror or error}") from error
        while len(data) < size and (more := file.read(size + 1 - len(data))):  # the system gives 2 GB at once
            data += more
        if len(data) != size:
            how = "grew" if len(data) > size else f"shrank to {len(data)} bytes"
            raise UserError(f"{path} had {size} bytes and {how} while it was read: wait until it is written")
        check(data[:HEAD])
        return data


def read_pipe(
    file: Readable,
    name: str,
    *,
    most: int = LARGEST_PIPE,
    memory: int | float = 1.0,
    check: Callable[[bytes], None] = lambda head: None,
) -> bytes:
    """All that comes through a pipe.

    Args:
        file: the pipe's end.
        name: what messages call it.
        most: bytes that are read at most.
        memory: as in `read_bytes`.
        check: as in `read_bytes`.

    Raises:
        UserError: it does not end within `most` bytes or the memory that is free, or cannot be read.
    """
    data = bytearray()
    checked, asked = False, FREELY
    try:
        while more := file.read(CHUNK):
            data += more
            if not checked and len(data) >= HEAD:
                check(bytes(data[:HEAD]))
                checked = True
            if len(data) > most:
                raise UserError(f"{name} did not end within {gigabytes(most)}, the most that is read: give a file")
            if len(data) * memory > asked:
                check_memory(len(data) * memory, f"{name} ({gigabytes(len(data))} so far)")
                asked *= 2
    except OSError as error:
        raise UserError(f"{name} cannot be read: {error.strerror or error}") from error
    if not checked:
        check(bytes(data[:HEAD]))
    return bytes(data)


def check_file(path: Path) -> None:
    """Refuse what is no regular file, or cannot be opened.

    Raises:
        UserError: it is none.
    """
    with _opened(path) as file:
        if stat.S_ISFIFO(os.fstat(file.fileno()).st_mode):
            raise UserError(f"{path} cannot be read: it is a pipe: write what comes through it into a file")


def _opened(path: Path) -> FileIO:
    """The file, opened without waiting for anybody.

    Raises:
        UserError: it cannot be opened, or is neither a file nor a pipe.
    """
    # Without O_NONBLOCK a pipe that nobody writes into would be waited for, without an end.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOCTTY", 0)
    try:
        number = os.open(path, flags)
    except OSError as error:
        reason = SOCKET if error.errno == errno.ENXIO else error.strerror or error
        raise UserError(f"{shown_path(path)} cannot be read: {reason}") from error
    except ValueError as error:  # a NUL, which ends names for the system
        raise UserError(f"{shown_path(path)} cannot be read: no file has such a name") from error
    kind = stat.S_IFMT(os.fstat(number).st_mode)
    if kind not in (stat.S_IFREG, stat.S_IFIFO):
        os.close(number)
        what = KINDS.get(kind, "something else")
        raise UserError(f"{path} cannot be read: it is {what}, not a file: name a file, or a pipe")
    if hasattr(os, "set_blocking"):
        os.set_blocking(number, True)
    return FileIO(number, "r")


def _wait(file: FileIO, path: Path) -> None:
    """Wait until something comes through a pipe with a name.

    Raises:
        UserError: nothing did for `PATIENCE` seconds.
    """
    # Who made a pipe without a name, as `<(command)` does, writes into it for sure, at whatever time.
    if os.path.realpath(path).startswith(("/proc/", "/dev/fd/")) or not hasattr(select, "poll"):
        return
    poll = select.poll()
    poll.register(file, select.POLLIN | select.POLLHUP)
    if not poll.poll(PATIENCE * 1000):
        raise UserError(
            f"{path} cannot be read: it is a pipe, and nobody wrote into it for {PATIENCE:g} s: "
            f"start what writes into it first, or name a file"
        )
