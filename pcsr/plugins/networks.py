"""Networks of foreign code: classes and functions in Python files that a user names."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pcsr.errors import UserError, did_you_mean
from pcsr.plugins.code import file_code
from pcsr.plugins.registry import Registry


def find_network(registry: Registry, network: str) -> tuple[Path, Callable[..., Any]]:
    """Find the class of a network, or the function that returns it, in the plugin files of a registry.

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
        found = _attribute(registry.modules[path], name)
        if callable(found):
            return path, found
    if named:
        known = [key for key, value in vars(registry.modules[named[0]]).items() if _is_network(value)]
        raise UserError(f"{named[0]} has no class or function '{name}': {did_you_mean(name, known)}")
    raise UserError(
        f"the network '{name}' of the file {file}: hand in that file with --plugin (in Python: plugins=[…])"
    )


def network_code(registry: Registry, network: str) -> str | None:
    """Hash the file of a network and the modules of its repository that it imports."""
    file, _ = find_network(registry, network)
    return file_code(file, registry.imports.get(file, ()))


def holds_networks(module: object) -> bool:
    """Return whether a module has classes or functions and no part of pcsr, as files of foreign networks have."""
    if hasattr(module, "pcsr_register"):  # a plugin that lacks the mark
        return False
    values = [value for name, value in vars(module).items() if not name.startswith("_") and callable(value)]
    return bool(values) and not any(isinstance(value, type) and _is_part(value) for value in values)


def _attribute(module: object, name: str) -> Any:
    found: Any = module
    for part in name.split("."):
        found = getattr(found, part, None)
    return found


def _is_network(value: Any) -> bool:
    torch = sys.modules.get("torch")
    if torch is None or not isinstance(value, type) or not issubclass(value, torch.nn.Module):
        return False
    return not _is_part(value) and not value.__module__.startswith("torch.")


def _is_part(kind: type) -> bool:
    contracts = sys.modules.get("pcsr.contracts")
    return contracts is not None and issubclass(kind, contracts.Part)
