"""What code of a plugin changes in the process around it is set back: other parts would compute something else.

Torch and numpy are looked at only where they are loaded: help pages load neither.
"""

import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from io import StringIO
from typing import Any

from pcsr.errors import PcsrWarning

THREADS = ("OMP_NUM_THREADS", "OMP_WAIT_POLICY", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMEXPR_NUM_THREADS")
"""Variables of the environment by which libraries choose their number of threads."""


@dataclass(frozen=True)
class Setting:
    """One thing that all code of a process shares."""

    name: str
    read: Callable[[], Any]
    write: Callable[[Any], object]
    module: str = ""
    """Which must be loaded for the setting to be there."""
    fresh: Any = None
    """The value right after the module is loaded; None: not known."""


def _torch() -> Any:
    return sys.modules["torch"]


def _numpy() -> Any:
    return sys.modules["numpy"]


def _handlers() -> dict[int, Any]:
    return {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}


def _set_handlers(handlers: dict[int, Any]) -> None:
    if threading.current_thread() is threading.main_thread():
        for number, handler in handlers.items():
            if handler is not None:  # of a handler that was not set from Python
                signal.signal(number, handler)


def _set_variables(values: dict[str, str | None]) -> None:
    for name, value in values.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


def _hidden_warnings() -> list[Any]:
    """The filters by which pcsr's own warnings would be hidden, or become errors."""
    of_all = [one for one in warnings.filters if one[1] is None and one[3] is None]
    return [one for one in of_all if one[0] in ("ignore", "error") and issubclass(PcsrWarning, one[2])]


def _set_hidden_warnings(before: list[Any]) -> None:
    for one in [one for one in _hidden_warnings() if one not in before]:
        warnings.filters.remove(one)  # type: ignore[attr-defined] # it is a list, by the documentation too


def _folder() -> str:
    with suppress(OSError):
        return os.getcwd()
    return ""


SETTINGS = (
    Setting("the working directory", _folder, lambda folder: os.chdir(folder or ".")),
    Setting(
        "variables of the environment for threads",
        lambda: {name: os.environ.get(name) for name in THREADS},
        _set_variables,
    ),
    Setting("handlers of signals", _handlers, _set_handlers),
    Setting("filters of warnings", _hidden_warnings, _set_hidden_warnings),
    Setting(
        "numpy's handling of errors",
        lambda: _numpy().geterr(),
        lambda state: _numpy().seterr(**state),
        "numpy",
        {"divide": "warn", "over": "warn", "under": "ignore", "invalid": "warn"},
    ),
    Setting(
        "numpy's print options",
        lambda: _numpy().get_printoptions(),
        lambda options: _numpy().set_printoptions(**options),
        "numpy",
    ),
    Setting(
        "torch's default dtype",
        lambda: str(_torch().get_default_dtype()),
        lambda dtype: _torch().set_default_dtype(getattr(_torch(), dtype.removeprefix("torch."))),
        "torch",
        "torch.float32",
    ),
    Setting(
        "torch's default device",
        lambda: str(_torch().get_default_device()),
        lambda device: _torch().set_default_device(None if device == "cpu" else device),
        "torch",
        "cpu",
    ),
    Setting(
        "torch's number of threads",
        lambda: _torch().get_num_threads(),
        lambda count: _torch().set_num_threads(count),
        "torch",
    ),
    Setting(
        "torch's gradients",
        lambda: _torch().is_grad_enabled(),
        lambda on: _torch().set_grad_enabled(on),
        "torch",
        True,
    ),
    Setting(
        "torch's deterministic algorithms",
        lambda: _torch().are_deterministic_algorithms_enabled(),
        lambda on: _torch().use_deterministic_algorithms(on),
        "torch",
        False,
    ),
    Setting(
        "torch's precision of matrix products",
        lambda: _torch().get_float32_matmul_precision(),
        lambda precision: _torch().set_float32_matmul_precision(precision),
        "torch",
        "highest",
    ),
)


def _changed(before: dict[str, Any]) -> list[str]:
    """Set back what is no longer as it was; what that is, in words."""
    found = []
    for setting in SETTINGS:
        was = before.get(setting.name)
        if was is None or setting.module not in ("", *sys.modules):
            continue
        now = setting.read()
        if now != was:
            setting.write(was)
            to = f" to {now}" if isinstance(now, str | int) else ""
            found.append(f"{setting.name}{to}")
    return found


def _now() -> dict[str, Any]:
    return {
        setting.name: setting.read() if setting.module in ("", *sys.modules) else setting.fresh for setting in SETTINGS
    }


@contextmanager
def watched() -> Iterator[list[str]]:
    """Set back what the code within changes of the process, and list it: complete once the context has ended."""
    before = _now()
    changes: list[str] = []
    try:
        yield changes
    finally:
        changes += _changed(before)


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
