"""Hook specification of pcsr. A plugin is a module with a function `pcsr_register`, marked `@pcsr.hookimpl`."""

from typing import TYPE_CHECKING

import pluggy

if TYPE_CHECKING:
    from pcsr.plugins.registry import Register

hookspec = pluggy.HookspecMarker("pcsr")
hookimpl = pluggy.HookimplMarker("pcsr")


@hookspec
def pcsr_register(register: "Register") -> None:
    """Register the parts of a plugin, for example ``register.fusion("cross-attention", CrossAttention)``.

    A part is given as its class, or as text ``"package.module:Class"``, which is imported when the part is first used.

    Examples:
        >>> @pcsr.hookimpl
        ... def pcsr_register(register):
        ...     register.fusion("my-fusion", "my_package.parts:MyFusion")
    """
