"""Networks of foreign code: classes and functions in Python files that a user names."""

import sys
import typing
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pcsr.errors import UserError, did_you_mean
from pcsr.plugins.code import file_code
from pcsr.plugins.registry import Registry


def find_network(registry: Registry, network: str) -> tuple[Path, Callable[..., Any]]:
    """Find the class of a network, or the function that returns it, in the plugin files of a registry.

    A weights file may name it, so that nothing else in these files can be called: a class must be derived from
    `torch.nn.Module`, and a function annotated as returning one.

    Args:
        registry: with the files.
        network: `file.py:Name`. If no file of this name is loaded, any that has the name will do.

    Returns:
        The file, and the class or function.

    Raises:
        UserError: no file has it; the message says what to hand in.
    """
    file, _, name = network.rpartition(":")
    named = [path for path in registry.modules if path.name == file]
    for path in named or registry.modules:
        found: Any = vars(registry.modules[path]).get(name)
        if makes_network(found):
            return path, found
    if named and name in vars(registry.modules[named[0]]):
        raise UserError(
            f"'{name}' of {named[0]} is no class derived from torch.nn.Module, nor a function annotated as returning "
            f"one: write `def {name}(…) -> torch.nn.Module:`"
        )
    if named:
        known = [key for key, value in vars(registry.modules[named[0]]).items() if makes_network(value)]
        raise UserError(f"{named[0]} has no network '{name}': {did_you_mean(name, known)}")
    raise UserError(
        f"the network '{name}' of the file {file}: hand in that file with --plugin (in Python: plugins=[…])"
    )


def network_code(registry: Registry, network: str) -> str | None:
    """Hash the file of a network and the modules of its repository that it imports."""
    file, _ = find_network(registry, network)
    return file_code(file, registry.imports.get(file, ()))


def holds_networks(module: object) -> bool:
    """Return whether a module has the class of a network that is no part of pcsr, or a function that returns one."""
    return any(makes_network(value) for value in vars(module).values())


def makes_network(value: Any) -> bool:
    """Return whether a value is the class of a network, not of a part of pcsr, or a function that returns one.

    A function must be annotated, so that it need not be called.
    """
    if isinstance(value, type):
        return _is_network(value)
    try:
        return callable(value) and _is_network(typing.get_type_hints(value).get("return"), of_torch=True)
    except Exception:  # hints that cannot be evaluated
        return False


def _is_network(kind: Any, *, of_torch: bool = False) -> bool:
    torch, contracts = sys.modules.get("torch"), sys.modules.get("pcsr.contracts")
    if torch is None or not isinstance(kind, type) or not issubclass(kind, torch.nn.Module):
        return False
    is_part = contracts is not None and issubclass(kind, contracts.Part)
    return not is_part and (of_torch or not kind.__module__.startswith("torch."))
