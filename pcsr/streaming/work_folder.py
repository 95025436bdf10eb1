"""Folder with the finished parts of an upsampled cloud, from which an interrupted command continues."""

import errno
import json
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from glob import escape
from io import BufferedWriter
from pathlib import Path
from typing import Any

import numpy as np

from pcsr.errors import RunError, UserError
from pcsr.files import write_text, write_whole
from pcsr.limits import gigabytes

SUFFIX = ".parts"
"""Suffix of the folder's name, which begins with that of the result."""
AGAIN = "free some space, and run the same command again: what is finished is kept"
ABOUT, LOCK = "command.json", "lock"
"""Names of the files with the command and of the lock."""


class WorkFolder:
    """Folder beside the result. Each file in it is written whole or not at all, but for those of `start_anew`.

    Args:
        target: path of the result.
    """

    def __init__(self, target: Path) -> None:
        self.target = target
        self.path = target.with_name(target.name + SUFFIX)
        self.needed = 0
        """Bytes that the work still takes on the disk, about."""

    @contextmanager
    def opened(self, command: Mapping[str, Any]) -> Iterator[None]:
        """Create or continue the folder, and lock it for the length of a block.

        Args:
            command: all that the result depends on, by the words for it in messages; JSON values.

        Raises:
            UserError: the folder is of another command, or no folder of this kind, or another process uses it.
        """
        about = self.path / ABOUT
        if self.path.exists() and not (self.path.is_dir() and (about.is_file() or self._is_new())):
            raise UserError(f"{self.path} is in the way of the folder for unfinished work: rename or remove it")
        self.path.mkdir(parents=True, exist_ok=True)
        with (self.path / LOCK).open("w") as lock:
            _lock(lock, self.path)
            self._remove_halves()
            if about.is_file():
                _check_same(json.loads(about.read_text(encoding="utf-8")), command, self.path)
            else:
                write_text(about, json.dumps(command, indent=1))
            yield

    def remove(self) -> None:
        """Remove the folder with all that is in it."""
        for path in self.path.iterdir():
            if path.name != ABOUT:  # last, so that the folder is known as one of pcsr's until then
                path.unlink(missing_ok=True)
        shutil.rmtree(self.path, ignore_errors=True)

    def _remove_halves(self) -> None:
        """Remove the temporary files of `write_whole` that a killed process left behind."""
        for folder, name in ((self.target.parent, escape(self.target.name)), (self.path, "*")):
            for path in folder.glob(f".{name}.*.part"):
                path.unlink(missing_ok=True)

    def _is_new(self) -> bool:
        """Return whether the folder is empty, or was left before its first file was written."""
        return all(path.name == LOCK or path.name.startswith(f".{ABOUT}") for path in self.path.iterdir())

    def plan(self) -> dict[str, Any] | None:
        """Return what `save_plan` wrote; None if the points are not sorted yet."""
        path = self.path / "plan.json"
        if not path.is_file():
            return None
        plan: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        return plan

    def save_plan(self, plan: Mapping[str, Any]) -> None:
        """Write the plan: from now on, the points are sorted."""
        write_text(self.path / "plan.json", json.dumps(plan))

    def start_anew(self) -> None:
        """Remove what an interrupted sorting left behind."""
        for path in self.path.glob("*"):
            if path.suffix in (".rows", ".npy"):
                path.unlink()

    def appended(self, name: str) -> BufferedWriter:
        """Open a file of raw rows for appending."""
        return (self.path / f"{name}.rows").open("ab")

    def raw(self, name: str, dtype: Any) -> np.ndarray:
        """Return the rows of a file of raw rows; none if there is no such file."""
        path = self.path / f"{name}.rows"
        return np.fromfile(path, dtype) if path.exists() else np.zeros(0, dtype)

    def raw_path(self, name: str) -> Path:
        """Return the path of a file of raw rows."""
        return self.path / f"{name}.rows"

    def drop_raw(self, name: str) -> None:
        """Remove a file of raw rows."""
        (self.path / f"{name}.rows").unlink(missing_ok=True)

    def save(self, name: str, array: np.ndarray) -> None:
        """Write an array as a file, whole or not at all."""

        def write(part: Path) -> None:
            with part.open("wb") as file:
                np.lib.format.write_array(file, array, allow_pickle=False)

        write_whole(self.path / f"{name}.npy", write)

    def has(self, name: str) -> bool:
        """Return whether an array is there."""
        return (self.path / f"{name}.npy").is_file()

    def load(self, name: str) -> np.ndarray:
        """Read an array."""
        array: np.ndarray = np.load(self.path / f"{name}.npy", allow_pickle=False)
        return array


@contextmanager
def refused_without_trace(work: WorkFolder) -> Iterator[None]:
    """Remove the folder if a block refuses its input before a tile is finished: the command could never end."""
    try:
        yield
    except UserError:
        if not any(work.path.glob("new-*.npy")):
            work.remove()
        raise


@contextmanager
def damage_explained(work: WorkFolder) -> Iterator[None]:
    """Turn the errors that damaged files of an earlier folder cause in a block into one that names the remedy.

    Raises:
        UserError: a file in the folder is damaged or missing.
    """
    earlier = work.path.is_dir()
    try:
        yield
    except (ValueError, LookupError, EOFError, TypeError, AttributeError, OSError) as error:
        own = not isinstance(error, OSError) or str(work.path) in str(error.filename)
        if not (earlier and own):
            raise
        raise UserError(
            f"{work.path} holds unfinished work of which a file is damaged or missing: remove the folder to begin anew"
        ) from error


@contextmanager
def full_disk_explained(work: WorkFolder) -> Iterator[None]:
    """Say how much room is needed, if the disk becomes full in a block.

    Raises:
        RunError: the disk is full.
    """
    try:
        yield
    except (OSError, RunError) as error:
        cause = error.__cause__ if isinstance(error, RunError) else error
        if not (isinstance(cause, OSError) and cause.errno in (errno.ENOSPC, errno.EDQUOT)):
            raise
        raise RunError(
            f"the disk of {work.path} is full, and up to {gigabytes(work.needed)} more are written there: {AGAIN}"
        ) from error


def check_room(work: WorkFolder) -> None:
    """Check that the disk has room for the rest of the work.

    Raises:
        RunError: it has less.
    """
    free = shutil.disk_usage(work.path).free
    if free < work.needed:
        raise RunError(
            f"the disk of {work.path} has {gigabytes(free)} free, and {gigabytes(work.needed)} more are written there: "
            f"{AGAIN}"
        )


def _check_same(there: Mapping[str, Any], here: Mapping[str, Any], folder: Path) -> None:
    other = [name for name in here if there.get(name) != here[name]]
    if other:
        raise UserError(
            f"{folder} holds the unfinished work of another command, whose {', '.join(other)} differed: run that "
            f"command again to finish it, or remove the folder to begin anew"
        )


def _lock(file: Any, folder: Path) -> None:
    """Lock a file until it is closed; the system unlocks it when the process ends, for whatever reason."""
    try:
        try:
            import fcntl
        except ImportError:  # Windows
            import msvcrt

            msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
        else:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.ENOSYS, errno.ENOTSUP, errno.ENOLCK):
            return  # a file system without locks
        raise UserError(f"{folder} is in use by another process: wait until it is done, or name another OUT") from error
