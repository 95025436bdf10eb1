"""Guards that restore settings of the process, such as torch's default dtype, after code of a plugin changed them."""

import os
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import StringIO
from typing import Any

from pcsr.errors import PcsrWarning
from pcsr.plugins.process_settings import current, restore


@contextmanager
def watched() -> Iterator[list[str]]:
    """Restore the settings of the process that the code in the context changes.

    Yields:
        Descriptions of the changes; the list is filled when the context ends.
    """
    before = current()
    changes: list[str] = []
    try:
        yield changes
    finally:
        changes += restore(before)


@contextmanager
def guarded(owner: str) -> Iterator[None]:
    """Do as `watched`, and warn of each change.

    Args:
        owner: what the code in the context belongs to, for the warning: "plugin lab.py".

    Warns:
        PcsrWarning: the code changed a setting.
    """
    try:
        with watched() as changes:
            yield
    finally:
        _warn(owner, changes)


@contextmanager
def guarded_import(owner: str) -> Iterator[None]:
    """Do as `guarded`, for the import of a module: the standard streams and `sys.path` are restored too.

    Standard output is redirected to standard error, since `pcsr upsample -o -` writes a cloud to standard output.
    Standard input is empty. One thread at a time is inside such a context.

    Args:
        owner: what the code in the context belongs to, for the warning.

    Warns:
        PcsrWarning: the code changed a setting, a stream or `sys.path`.
    """
    with LOADING:
        path = list(sys.path)
        stderr = sys.stderr
        streams = [_Stream("stdin", StringIO())]
        streams += [_Stream("stdout", _StandIn(stderr)), _Stream("stderr", _StandIn(stderr))]
        try:
            with guarded(owner):
                yield
        finally:
            changes = [f"sys.{stream.name}" for stream in streams if stream.restore()]
            removed = [folder for folder in path if folder not in sys.path]
            if removed or not all(isinstance(one, str) for one in sys.path):
                sys.path[:] = path
                changes.append("sys.path")
            _warn(owner, changes)


LOADING = threading.RLock()
"""Lock that is held while a module of a plugin is imported."""


class _Stream:
    """Standard stream that is replaced by a stand-in until `restore`."""

    def __init__(self, name: str, stand_in: Any) -> None:
        self.name = name
        self.number = ("stdin", "stdout", "stderr").index(name)
        self.stream = getattr(sys, name)
        self.open = self.stream is not None and not self.stream.closed
        self.stand_in = stand_in
        self.copy: int | None = None
        with suppress(OSError):  # the shell closed the stream
            self.copy = os.dup(self.number)
        setattr(sys, name, stand_in)

    def restore(self) -> bool:
        """Restore the stream, reopened if it was closed, and return whether it had been replaced or closed."""
        spoilt = getattr(sys, self.name) is not self.stand_in or bool(self.stand_in.closed)
        if self.copy is not None:
            try:
                os.fstat(self.number)
            except OSError:
                os.dup2(self.copy, self.number)
                spoilt = True
            os.close(self.copy)
        if self.open and self.stream.closed:
            mode = "w" if self.number else "r"
            self.stream = open(self.number, mode, encoding="utf-8", closefd=False)  # noqa: SIM115 it stays open
            spoilt = True
        setattr(sys, self.name, self.stream)
        return spoilt


class _StandIn:
    """Stream that forwards everything to another one, except `close`."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.closed = False

    def write(self, text: str) -> int:
        """Write text to the other stream."""
        return len(text) if self._stream is None else self._stream.write(text)

    def flush(self) -> None:
        """Flush the other stream."""
        if self._stream is not None:
            self._stream.flush()

    def close(self) -> None:
        """Mark this stream as closed, and leave the other open."""
        self.closed = True

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _warn(owner: str, changes: list[str]) -> None:
    for change in changes:
        warnings.warn(f"{owner} changed {change}: restored, as it would change other parts' results", PcsrWarning, 4)
