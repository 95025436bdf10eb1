"""Settings that all code of a process shares: those of torch, numpy, warnings, signals, the environment.

Torch and numpy are looked at only where they are loaded: help pages load neither.
"""

import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
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


def current() -> dict[str, Any]:
    """The value of each setting by its name, as `set_back` takes them."""
    return {
        setting.name: setting.read() if setting.module in ("", *sys.modules) else setting.fresh for setting in SETTINGS
    }


def set_back(before: dict[str, Any]) -> list[str]:
    """Set back what is no longer as it was.

    Args:
        before: what `current` gave.

    Returns:
        What was set back, in words: "torch's default dtype to torch.float64".
    """
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
