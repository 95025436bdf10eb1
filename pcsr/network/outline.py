"""The outline of a network: names and shapes of its weights, known before any memory is spent on them."""

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
from pcsr.network.build import build
from pcsr.network.network import Network
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe

LAYERS = 1000
"""Layers, weights and buffers that any network may have, beside
`LAYERS_PER_WEIGHT` for each of its weights: activations, containers, layers that are built and thrown away."""
LAYERS_PER_WEIGHT = 20
COMPUTED = 1 << 24
"""Most numbers in buffers that are computed when a network is built and stored in no file (64 MB)."""


def outline(recipe: Recipe, registry: Registry, weights: int) -> Network | None:
    """The network of a recipe without memory for its weights (on torch's device `meta`).

    Args:
        recipe: its parts are checked.
        registry: gives them.
        weights: how many weights it is expected to have. Building ends where it has many more layers than that.

    Returns:
        None where a part cannot be built without memory.

    Raises:
        UserError: many more layers than weights, large buffers, or parts that don't fit together.
    """
    try:
        with bounded(weights), torch.device("meta"):
            network = build(recipe, registry)
    except (UserError, MemoryError):
        raise
    except Exception:  # a constructor that computes with numbers, which there are none of: built for real it says more
        return None
    stored = network.state_dict().keys()
    computed = sum(buffer.numel() for name, buffer in network.named_buffers() if name not in stored)
    if computed > COMPUTED:
        raise UserError(f"its buffers hold {computed} numbers, and {COMPUTED} is the most")
    return network


@contextmanager
def bounded(weights: int) -> Iterator[None]:
    """Within it, building a network of many more layers than weights ends early.

    Raises:
        UserError: it has.
    """
    most = LAYERS + LAYERS_PER_WEIGHT * weights
    thread, count = threading.get_ident(), 0

    def registered(*_: Any) -> None:
        nonlocal count
        if threading.get_ident() != thread:  # the hooks are the whole process's
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
