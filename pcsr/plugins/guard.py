"""What code of a plugin changes in the process around it is set back: other parts would compute something else."""

import os
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import StringIO
from typing import Any

from pcsr.errors import PcsrWarning
from pcsr.plugins.process_settings import current, set_back


@contextmanager
def watched() -> Iterator[list[str]]:
    """Set back what the code within changes of the process, and list it: complete once the context has ended."""
    before = current()
    changes: list[str] = []
    try:
        yield changes
    finally:
        changes += set_back(before)


@contextmanager
def guarded(who: str) -> Iterator[None]:
    """As `watched`; who changed something is named in a warning.

    Args:
        who: whose code runs within: "plugin lab.py".
    """
    try:
        with watched() as changes:
            yield
    finally:
        _tell(who, changes)


@contextmanager
def guarded_import(who: str) -> Iterator[None]:
    """As `guarded`, for code that is loaded: its streams and the places where modules are looked for are kept too.

    What it prints goes to standard error, since standard output may be a cloud on its way to another command; and it
    has nothing to read. Threads load one after the other.
    """
    with LOADING:
        path = list(sys.path)
        heard = sys.stderr
        streams = [_Stream("stdin", StringIO())]
        streams += [_Stream("stdout", _StandIn(heard)), _Stream("stderr", _StandIn(heard))]
        try:
            with guarded(who):
                yield
        finally:
            changes = [f"sys.{stream.name}" for stream in streams if stream.put_back()]
            if [place for place in path if place not in sys.path] or not all(isinstance(one, str) for one in sys.path):
                sys.path[:] = path
                changes.append("sys.path")
            _tell(who, changes)


LOADING = threading.RLock()


class _Stream:
    """One of the three standard streams, with a stand-in in its place until it is put back."""

    def __init__(self, name: str, stand_in: Any) -> None:
        self.name = name
        self.number = ("stdin", "stdout", "stderr").index(name)
        self.stream = getattr(sys, name)
        self.open = self.stream is not None and not self.stream.closed
        self.stand_in = stand_in
        self.copy: int | None = None
        with suppress(OSError):  # closed by the shell
            self.copy = os.dup(self.number)
        setattr(sys, name, stand_in)

    def put_back(self) -> bool:
        """Put the stream back, open as it was; whether somebody had replaced or closed it."""
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
    """A stream in another's place: it passes everything on, but closing it closes nothing."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self.closed = False

    def write(self, text: str) -> int:
        """Pass text on."""
        return len(text) if self._stream is None else self._stream.write(text)

    def flush(self) -> None:
        """Pass it on."""
        if self._stream is not None:
            self._stream.flush()

    def close(self) -> None:
        """Note that it was asked to."""
        self.closed = True

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def _tell(who: str, changes: list[str]) -> None:
    for change in changes:
        warnings.warn(f"{who} changed {change}: set back, as it would change other parts' results", PcsrWarning, 4)
