"""Outline of a network: names and shapes of its weights, computed without memory for them."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch
from torch.nn.modules.module import (
    register_module_buffer_registration_hook,
    register_module_module_registration_hook,
    register_module_parameter_registration_hook,
)

from pcsr.errors import UserError
from pcsr.grafting.injection_point import InjectionPoint
from pcsr.network.build import build
from pcsr.network.kinds import AnyNetwork
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe

LAYERS = 1000
"""Number of modules, parameters and buffers that any network may register, such as activations and containers."""
LAYERS_PER_WEIGHT = 20
"""Number of modules, parameters and buffers that a network may register for each of its weights, beyond `LAYERS`."""
COMPUTED = 1 << 24
"""Largest number of elements in buffers that are computed when a network is built, and not stored (64 MB)."""


def outline(recipe: Recipe, registry: Registry, weights: int, point: InjectionPoint | None = None) -> AnyNetwork | None:
    """Build the network of a recipe without memory for its weights, on torch's device `meta`.

    Args:
        recipe: recipe whose parts are checked.
        registry: installed parts.
        weights: expected number of weights. Building stops if there are many more layers.
        point: layer of a graft.

    Returns:
        The network, or `None` if a part cannot be built on `meta`.

    Raises:
        UserError: there are many more layers than weights, buffers are large, or parts do not fit together.
    """
    try:
        with bounded(weights), torch.device("meta"):
            network = build(recipe, registry, point)
    except (UserError, MemoryError):
        raise
    except Exception:  # a constructor needs values, which `meta` lacks; other errors recur when memory is used
        return None
    stored = network.state_dict().keys()
    computed = sum(buffer.numel() for name, buffer in network.named_buffers() if name not in stored)
    if computed > COMPUTED:
        raise UserError(f"its buffers hold {computed} numbers, and {COMPUTED} is the most")
    return network


@contextmanager
def bounded(weights: int) -> Iterator[None]:
    """Limit the number of layers of a network that is built within the context.

    Args:
        weights: expected number of weights.

    Raises:
        UserError: the network has many more layers than weights.
    """
    most = LAYERS + LAYERS_PER_WEIGHT * weights
    thread, count = threading.get_ident(), 0

    def registered(*_: Any) -> None:
        nonlocal count
        if threading.get_ident() != thread:  # the hooks are called for all threads of the process
            return
        count += 1
        if count > most:
            raise UserError(f"its options ask for more than {most} layers, and the file holds {weights} weights")

    hooks = [
        register(registered)
        for register in (
            register_module_module_registration_hook,
            register_module_parameter_registration_hook,
            register_module_buffer_registration_hook,
        )
    ]
    try:
        yield
    finally:
        for hook in hooks:
            hook.remove()
