"""Shapes `blobs`: smooth closed bodies generated on the spot, like animals, figures, fruit and pots.

What `cad-parts` has none of: free-form surfaces, limbs, dents, soft detail. Lengths are millimetres.
"""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from pcsr_plugins.shapes.blobs import animals, figures, fruit, growths, rings, vessels
from pcsr_plugins.shapes.shared.draw import Draw
from pcsr_plugins.shapes.shared.generated import Generated, by_name

if TYPE_CHECKING:
    from manifold3d import Manifold

FAMILIES = by_name(
    *(animals.bird, animals.fish, animals.quadruped, animals.seated_animal, animals.tortoise),
    *(figures.bust, figures.figurine, figures.hand),
    *(fruit.gourd, fruit.pear, fruit.pebble, fruit.stone_fruit),
    *(growths.caterpillar, growths.coral, growths.mushroom, growths.starfish),
    *(rings.kettlebell, rings.knot, rings.loops, rings.ring_body),
    *(vessels.bottle, vessels.cup, vessels.jug, vessels.vase),
)


class Blobs(Generated):
    """Families of smooth bodies in turn, each body of a family different."""

    version = 1
    title = "blobs"

    @property
    def families(self) -> Mapping[str, Callable[[Draw], Any]]:
        """Smooth bodies."""
        return FAMILIES

    def solid(self, family: str, draw: Draw) -> "Manifold":
        """A body of a family."""
        from pcsr_plugins.shapes.blobs.isosurface import solid_of

        return solid_of(FAMILIES[family](draw))
