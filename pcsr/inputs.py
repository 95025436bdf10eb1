"""Bounded reading of input files and pipes."""

import errno
import os
import select
import stat
from collections.abc import Callable
from io import FileIO
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from pcsr.errors import UserError
from pcsr.limits import LARGEST_FILE, LARGEST_PIPE, LONGEST_LINE, UNCHECKED_SIZE, check_memory, gigabytes
from pcsr.validation_messages import shown_path

HEAD = 2 * LONGEST_LINE
"""Size in bytes of the beginning that is checked before the rest is read."""
CHUNK = 1 << 20
"""Bytes that are read from a pipe at once."""
PIPE_TIMEOUT = 10.0
"""Seconds to wait for the first byte of a named pipe."""
KINDS = {stat.S_IFDIR: "a folder", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device", stat.S_IFSOCK: "a socket"}
SOCKET = "it is a socket, not a file: name a file, or pass its content through a pipe"


@runtime_checkable
class Readable(Protocol):
    """Source of bytes, such as an open file."""

    def read(self, size: int, /) -> Any:
        """Read at most `size` bytes; return an empty result at the end."""


def read_bytes(
    path: Path,
    *,
    most: int = LARGEST_FILE,
    memory: int | float = 1.0,
    check: Callable[[bytes], None] = lambda head: None,
    remedy: str = "split it, or use a machine with more memory",
) -> bytes:
    """Read the whole content of a file or a named pipe.

    Named pipes are those of `mkfifo` and the shell's `<(command)`. A file that fails `check` is read no further than
    its beginning.

    Args:
        path: file or named pipe.
        most: largest allowed size in bytes.
        memory: memory that decoding the content takes, in multiples of its size.
        check: called with the beginning of the content, at most `HEAD` bytes; raises a `UserError` to refuse it.
        remedy: what to do with a file that does not fit into memory, for the message.

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
                f"{path} has {gigabytes(size)}, more than the {gigabytes(most)} that such a file may have: "
                f"name a smaller one"
            )
        check_memory(size * memory, f"{path} ({gigabytes(size)})", remedy)
        if size == 0:  # an empty file, or one of the system's, such as those in /proc, whose size is not known
            return read_pipe(file, str(path), most=most, memory=memory, check=check)
        try:
            if size > HEAD:
                check(file.read(HEAD))
                file.seek(0)
            data = file.read(size + 1)
        except OSError as error:
            raise UserError(f"{path} cannot be read: {error.strerror or error}") from error
        while len(data) < size and (more := file.read(size + 1 - len(data))):  # Linux returns at most 2 GB at once
            data += more
        if len(data) != size:
            how = "grew" if len(data) > size else f"shrank to {len(data)} bytes"
            raise UserError(f"{path} had {size} bytes and {how} while it was read: wait until it is complete")
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
    """Read a pipe to its end.

    Args:
        file: the end of the pipe to read from.
        name: name of the pipe in error messages.
        most: largest allowed size in bytes.
        memory: as in `read_bytes`.
        check: as in `read_bytes`.

    Raises:
        UserError: the content is larger than `most` or the free memory, or cannot be read.
    """
    data = bytearray()
    checked, next_check = False, UNCHECKED_SIZE
    try:
        while more := file.read(CHUNK):
            data += more
            if not checked and len(data) >= HEAD:
                check(bytes(data[:HEAD]))
                checked = True
            if len(data) > most:
                raise UserError(
                    f"{name} did not end within {gigabytes(most)}, the most that a pipe may have: name a file"
                )
            if len(data) * memory > next_check:
                check_memory(len(data) * memory, f"{name} ({gigabytes(len(data))} so far)")
                next_check *= 2
    except OSError as error:
        raise UserError(f"{name} cannot be read: {error.strerror or error}") from error
    if not checked:
        check(bytes(data[:HEAD]))
    return bytes(data)


def check_file(path: Path) -> None:
    """Check that a path names a regular file that can be opened.

    Raises:
        UserError: it does not.
    """
    with _opened(path) as file:
        if stat.S_ISFIFO(os.fstat(file.fileno()).st_mode):
            raise UserError(f"{path} cannot be read: it is a pipe: write its content to a file")


def _opened(path: Path) -> FileIO:
    """Open a file or pipe without blocking.

    Raises:
        UserError: it cannot be opened, or is neither a file nor a pipe.
    """
    # Without O_NONBLOCK, opening a pipe that has no writer would block forever.
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0) | getattr(os, "O_NOCTTY", 0)
    try:
        number = os.open(path, flags)
    except OSError as error:
        reason = SOCKET if error.errno == errno.ENXIO else error.strerror or error
        raise UserError(f"{shown_path(path)} cannot be read: {reason}") from error
    except ValueError as error:  # the name contains a NUL character
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
    """Wait until a named pipe has data.

    Raises:
        UserError: no data arrived within `PIPE_TIMEOUT` seconds.
    """
    # The pipe of a shell's `<(command)` always has a writer, which may take any time.
    if os.path.realpath(path).startswith(("/proc/", "/dev/fd/")) or not hasattr(select, "poll"):
        return
    poll = select.poll()
    poll.register(file, select.POLLIN | select.POLLHUP)
    if not poll.poll(PIPE_TIMEOUT * 1000):
        raise UserError(
            f"{path} cannot be read: it is a pipe, and nobody wrote into it for {PIPE_TIMEOUT:g} s: "
            f"start what writes into it first, or name a file"
        )
