"""What sources of generated objects share: families in turn, names, and splits that no parameter crosses."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeVar

from pydantic import Field

from pcsr import ShapeItem, ShapeSource, UserError
from pcsr.extras import require
from pcsr_plugins.shapes.shared.draw import SPLITS, Draw
from pcsr_plugins.shapes.shared.soundness import check_mesh

if TYPE_CHECKING:
    from manifold3d import Manifold

T = TypeVar("T")
Count = Annotated[int, Field(le=1_000_000)]
Seed = Annotated[int, Field(ge=-(2**63), lt=2**63)]

ATTEMPTS = 20
"""Draws tried for an object: some make one that falls apart, by a hole through its edge for example."""


def by_name(*functions: Callable[[Draw], T]) -> dict[str, Callable[[Draw], T]]:
    """Families by name, sorted, so that a small `count` mixes turned, milled and cast parts."""
    return {f.__name__.replace("_", "-"): f for f in sorted(functions, key=lambda f: f.__name__)}


class Generated(ShapeSource):
    """Families of objects in turn, each object of a family different. Lengths are mm.

    A source adds `families` and `solid`.
    """

    needs = frozenset({"manifold3d"})
    title: ClassVar[str]
    """What messages call the source: the name it is registered by."""

    def __init__(self, *, count: Count = 1600, held_out: Count = 96, seed: Seed = 0) -> None:
        """Choose how many.

        Args:
            count: training objects.
            held_out: validation objects, and as many test objects.
            seed: another seed, other objects.

        Raises:
            UserError: a number of objects is negative, or the extra `[simulate]` is not installed.
        """
        require(dict.fromkeys(self.needs, f"shapes '{self.title}'"))
        if min(count, held_out) < 0:
            raise UserError(f"{self.title}: count {count} and held_out {held_out} must not be negative")
        self.counts = {"train": count, "validation": held_out, "test": held_out}
        self.seed = seed

    @property
    def families(self) -> Mapping[str, Callable[[Draw], Any]]:
        """By name, in the order in which they take turns."""
        raise NotImplementedError

    def names(self, split: str) -> Sequence[str]:
        """``split/family/number``, families in turn.

        Raises:
            UserError: an unknown split.
        """
        if split not in self.counts:
            raise UserError(f"{self.title} has no split '{split}': it has {', '.join(self.counts)}")
        rounds, families = len(self.families), list(self.families)
        return [f"{split}/{families[i % rounds]}/{i // rounds:04d}" for i in range(self.counts[split])]

    def item(self, name: str) -> ShapeItem:
        """Generate one object: one watertight body.

        Raises:
            UserError: `name` is not one of `names`.
        """
        split, _, rest = name.partition("/")
        family, _, number = rest.partition("/")
        if split not in SPLITS or family not in self.families or not number.isdecimal():
            raise UserError(f"{self.title} has no object '{name}': they are called split/family/number")
        if int(number) * len(self.families) + list(self.families).index(family) >= self.counts[split]:
            raise UserError(
                f"{self.title} has no object '{name}' among {self.counts[split]} of '{split}': ask for more"
            )
        from pcsr_plugins.shapes.shared.surfaces import surface_of  # imports manifold3d

        for attempt in range(ATTEMPTS):
            mesh = surface_of(self.solid(family, Draw(split, _seed(self.seed, name, attempt))))
            if mesh is not None:
                return ShapeItem(name, family, check_mesh(mesh, name))
        raise UserError(f"{self.title} could not make '{name}' in one piece with seed {self.seed}: take another seed")

    def solid(self, family: str, draw: Draw) -> "Manifold":
        """An object of a family; one that is in pieces or empty is drawn again."""
        raise NotImplementedError

    def digest(self, name: str) -> str:
        """The seed, which decides the object together with the version and the name."""
        return f"seed {self.seed}"


def _seed(seed: int, name: str, attempt: int) -> int:
    return int.from_bytes(hashlib.sha256(f"{seed}/{name}/{attempt}".encode()).digest()[:8], "big")
