"""Settings that all code of a process shares: of torch, numpy, warnings, signals and the environment.

Settings of torch and numpy are read only if the module is loaded, since help pages load neither.
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
"""Environment variables by which libraries choose their number of threads."""


@dataclass(frozen=True)
class Setting:
    """Setting that all code of a process shares, with the functions that read and write it."""

    name: str
    read: Callable[[], Any]
    write: Callable[[Any], object]
    module: str = ""
    """Module that the setting belongs to; empty: it exists in every process."""
    initial: Any = None
    """Value right after the module is loaded. None: unknown."""


def _torch() -> Any:
    return sys.modules["torch"]


def _numpy() -> Any:
    return sys.modules["numpy"]


def _handlers() -> dict[int, Any]:
    return {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}


def _set_handlers(handlers: dict[int, Any]) -> None:
    if threading.current_thread() is threading.main_thread():
        for number, handler in handlers.items():
            if handler is not None:  # None: the handler was not set from Python
                signal.signal(number, handler)


def _set_variables(values: dict[str, str | None]) -> None:
    for name, value in values.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


def _hidden_warnings() -> list[Any]:
    """List the warning filters that hide pcsr's own warnings or turn them into errors."""
    general = [one for one in warnings.filters if one[1] is None and one[3] is None]
    return [one for one in general if one[0] in ("ignore", "error") and issubclass(PcsrWarning, one[2])]


def _set_hidden_warnings(before: list[Any]) -> None:
    for one in [one for one in _hidden_warnings() if one not in before]:
        warnings.filters.remove(one)  # type: ignore[attr-defined] # documented as a list


def _folder() -> str:
    with suppress(OSError):
        return os.getcwd()
    return ""


SETTINGS = (
    Setting("the working directory", _folder, lambda folder: os.chdir(folder or ".")),
    Setting(
        "the environment variables of threads",
        lambda: {name: os.environ.get(name) for name in THREADS},
        _set_variables,
    ),
    Setting("signal handlers", _handlers, _set_handlers),
    Setting("warning filters", _hidden_warnings, _set_hidden_warnings),
    Setting(
        "numpy's error handling",
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
        "whether torch computes gradients",
        lambda: _torch().is_grad_enabled(),
        lambda on: _torch().set_grad_enabled(on),
        "torch",
        True,
    ),
    Setting(
        "whether torch uses deterministic algorithms",
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
    """Return the value of each setting by its name."""
    return {
        setting.name: setting.read() if setting.module in ("", *sys.modules) else setting.initial
        for setting in SETTINGS
    }


def restore(before: dict[str, Any]) -> list[str]:
    """Restore all settings that have changed.

    Args:
        before: values to restore, from `current`.

    Returns:
        Descriptions of the changes that were undone: "torch's default dtype to torch.float64".
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
