"""The one hook of pcsr. A plugin is a module with a function of this name, marked `@pcsr.hookimpl`."""

from typing import TYPE_CHECKING

import pluggy

if TYPE_CHECKING:
    from pcsr.plugins.registry import Register

hookspec = pluggy.HookspecMarker("pcsr")
hookimpl = pluggy.HookimplMarker("pcsr")


@hookspec
def pcsr_register(register: "Register") -> None:
    """Register parts, a line each: ``register.fusion("cross-attention", CrossAttention)``.

    A part may be given as its class, or as text ``"package.module:Class"``, which is imported only when a
    recipe asks for the part.

    Examples:
        >>> @pcsr.hookimpl
        ... def pcsr_register(register):
        ...     register.fusion("my-fusion", "my_package.parts:MyFusion")
    """
