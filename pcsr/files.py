"""Atomic writing of files: into a temporary file in the same folder, which is then renamed over the target."""

import hashlib
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path, PureWindowsPath
from typing import TYPE_CHECKING

from pcsr.errors import RunError, UserError

if TYPE_CHECKING:
    from torch import Tensor


_umask = os.umask(0)  # it can be read only by setting it
os.umask(_umask)
MODE = 0o666 & ~_umask
"""Permissions of a new file: the system's default for this process."""


def check_target(path: Path) -> None:
    """Check that a regular file can be written to a path.

    Raises:
        UserError: the path is that of a folder, a device, a pipe or a socket.
    """
    if os.path.exists(path) and not os.path.isfile(path):
        what = "a folder" if os.path.isdir(path) else "a device, a pipe or a socket"
        raise UserError(f"{path} is {what}, and would be replaced by a file: name a file")


def inside(folder: Path, name: str) -> Path:
    """The path of a file that must lie in a folder.

    Raises:
        UserError: the name leads out of it.
    """
    path = folder / name
    try:
        leaves = not path.resolve().is_relative_to(folder.resolve()) or path.resolve() == folder.resolve()
    except (OSError, RuntimeError, ValueError):  # a link to itself, or a name that no file has
        leaves = True
    windows = PureWindowsPath(name)  # a name must not mean other files on another system
    if leaves or windows.anchor or ".." in windows.parts:
        raise UserError(
            f"file '{name[:99]}' is not inside of the recording's folder: put it there, and name it from there"
        )
    return path


def write_whole(path: Path, write: Callable[[Path], None]) -> None:
    """Write a file atomically: on an error the old file stays as it was.

    A symbolic link is kept; the file that it points to is replaced.

    Args:
        path: the file; missing folders are created.
        write: fills the temporary file whose path it receives.

    Raises:
        UserError: the path is that of a folder, a device, a pipe or a socket.
        RunError: the system reports an error, such as a full disk or a folder without write permission.
    """
    check_target(path)
    path = Path(os.path.realpath(path)) if path.is_symlink() else path
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(part)
        os.chmod(part, MODE)  # some libraries create files that only their owner can read
        os.replace(part, path)
    except OSError as error:
        kept = "; the old file is unharmed" if os.path.lexists(path) else ""
        raise RunError(f"{path} could not be written: {error.strerror or error}{kept}") from error
    finally:
        with suppress(OSError):  # the temporary file may be missing where writing failed
            part.unlink(missing_ok=True)


def identity(path: Path) -> tuple[int, ...] | None:
    """Device, inode, size and time of change of a file: equal where the file is the same; None where there is none."""
    try:
        about = path.stat()
    except OSError:
        return None
    return about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns


def sha256(path: Path) -> str:
    """Return the SHA-256 hash of a file in hexadecimal digits."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_text(path: Path, text: str) -> None:
    """Write a text file atomically, in UTF-8."""
    write_whole(path, lambda part: _write_text(part, text))


def _write_text(part: Path, text: str) -> None:
    part.write_text(text, encoding="utf-8", errors="backslashreplace")  # broken letters, as JSON may have in names


def write_bytes(path: Path, data: bytes) -> None:
    """Write a binary file whole."""
    write_whole(path, lambda part: _write_bytes(part, data))


def _write_bytes(part: Path, data: bytes) -> None:
    part.write_bytes(data)


def save_tensors(path: Path, tensors: Mapping[str, "Tensor"], metadata: dict[str, str]) -> None:
    """Write a safetensors file atomically."""
    from safetensors import SafetensorError
    from safetensors.torch import save_file

    def write(part: Path) -> None:
        try:
            save_file({name: t.detach().cpu().contiguous() for name, t in tensors.items()}, part, metadata)
        except SafetensorError as error:  # it wraps errors of the system, such as a full disk
            raise OSError(str(error)) from error

    write_whole(path, write)
