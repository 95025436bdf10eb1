"""Shapes `cad-parts`: mechanical parts generated on the spot. No download, the same on every machine.

The embedded stand-in for the ABC objects of TSR-PD (TAPSR, Sec. 4.1). Lengths are millimetres. What they lack
beside real parts is in docs/shapes.md.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from pcsr_plugins.shapes.shared.draw import Draw
from pcsr_plugins.shapes.shared.generated import Generated

if TYPE_CHECKING:
    from manifold3d import Manifold


class CadParts(Generated):
    """Families of parts in turn, each part of a family different."""

    version = 1
    title = "cad-parts"

    @property
    def families(self) -> Mapping[str, Callable[[Draw], Any]]:
        """Mechanical parts."""
        from pcsr_plugins.shapes.cad_parts.catalogue import FAMILIES

        return FAMILIES

    def solid(self, family: str, draw: Draw) -> "Manifold":
        """A part of a family."""
        solid: Manifold = self.families[family](draw)
        return solid
