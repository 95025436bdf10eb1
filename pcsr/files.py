"""Writing files whole or not at all: into a neighbour first, then renamed over the target in one step."""

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
"""What others may do with a file, as the system has it for new ones."""


def check_target(path: Path) -> None:
    """Refuse a path at which a whole file cannot be put: a folder, a device, a pipe or a socket.

    Raises:
        UserError: it is one.
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
    """Let `write` fill a temporary file beside `path`, which then takes its place; a link stays, with a new target.

    Raises:
        UserError: the path is that of a folder, a device, a pipe or a socket.
        RunError: the disk is full, the folder can't be written, or anything else that the system reports.
    """
    check_target(path)
    path = Path(os.path.realpath(path)) if path.is_symlink() else path
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write(part)
        os.chmod(part, MODE)  # some libraries make files that only their owner may read
        os.replace(part, path)
    except OSError as error:
        raise RunError(f"{path} could not be written: {error.strerror or error}; what was there is unharmed") from error
    finally:
        with suppress(OSError):  # where nothing could be written there is nothing to remove
            part.unlink(missing_ok=True)


def identity(path: Path) -> tuple[int, ...] | None:
    """Device, inode, size and time of change of a file: equal where the file is the same; None where there is none."""
    try:
        about = path.stat()
    except OSError:
        return None
    return about.st_dev, about.st_ino, about.st_size, about.st_mtime_ns


def sha256(path: Path) -> str:
    """Hash of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_text(path: Path, text: str) -> None:
    """Write a text file whole, in UTF-8."""
    write_whole(path, lambda part: _write_text(part, text))


def _write_text(part: Path, text: str) -> None:
    part.write_text(text, encoding="utf-8")


def save_tensors(path: Path, tensors: Mapping[str, "Tensor"], metadata: dict[str, str]) -> None:
    """Write a safetensors file whole."""
    from safetensors import SafetensorError
    from safetensors.torch import save_file

    def write(part: Path) -> None:
        try:
            save_file({name: t.detach().cpu().contiguous() for name, t in tensors.items()}, part, metadata)
        except SafetensorError as error:  # it wraps the error of the system, a full disk included
            raise OSError(str(error)) from error

    write_whole(path, write)
