"""Shapes `cad-parts`: mechanical parts generated on the spot. No download, the same on every machine.

The embedded stand-in for the ABC objects of TSR-PD (TAPSR, Sec. 4.1). Lengths are millimetres. What they lack
beside real parts is in docs/shapes.md.
"""

import hashlib
from collections.abc import Callable, Sequence

import numpy as np
import trimesh
from manifold3d import Manifold

from pcsr import Item, Shapes, UserError
from pcsr_plugins.shapes.families import blocks, fasteners, pipes, plates, toothed, turned_parts
from pcsr_plugins.shapes.families.draw import SPLITS, Draw

FAMILIES: dict[str, Callable[[Draw], Manifold]] = {
    function.__name__.replace("_", "-"): function
    for function in (
        plates.plate, plates.bracket, plates.flange, plates.hinge, plates.buckle, plates.gasket,
        blocks.clamp, blocks.housing, blocks.heat_sink, blocks.arch, blocks.pillow_block, blocks.manifold_block,
        blocks.machined_block, blocks.joint, blocks.lever, blocks.wedge_stop,
        turned_parts.knob, turned_parts.bearing, turned_parts.pulley, turned_parts.shaft, turned_parts.bushing,
        turned_parts.handwheel, turned_parts.lamp_post, turned_parts.nozzle,
        toothed.gear, toothed.sprocket, toothed.ratchet, toothed.cam, toothed.impeller,
        fasteners.bolt, fasteners.nut, fasteners.spring, fasteners.hook, fasteners.chain_link, fasteners.clip,
        fasteners.stand_off,
        pipes.tee, pipes.elbow, pipes.valve, pipes.duct,
    )
}  # fmt: skip
GRID = 1e-5
"""Vertices are rounded to this, in mm: the last bits of sines differ between machines, millimetres don't."""

SLIVER = 2e-3
"""Edges shorter than this, in mm, are collapsed: they are left over where cuts almost meet."""


class CadParts(Shapes):
    """Families of parts in turn, each part of a family different."""

    def __init__(self, *, count: int = 1600, held_out: int = 80, seed: int = 0) -> None:
        """Choose how many.

        Args:
            count: training parts.
            held_out: validation parts, and as many test parts.
            seed: another seed, other parts.
        """
        self.counts = {"train": count, "validation": held_out, "test": held_out}
        self.seed = seed

    def names(self, split: str) -> Sequence[str]:
        """``split/family/number``, families in turn."""
        if split not in self.counts:
            raise UserError(f"cad-parts has no split '{split}': it has {', '.join(self.counts)}")
        families = list(FAMILIES)
        return [
            f"{split}/{families[i % len(families)]}/{i // len(families):04d}" for i in range(self.counts[split])
        ]

    def item(self, name: str) -> Item:
        """Generate one part."""
        split, _, rest = name.partition("/")
        family, _, number = rest.partition("/")
        if split not in SPLITS or family not in FAMILIES or not number.isdigit():
            raise UserError(f"cad-parts has no part '{name}': parts are called split/family/number")
        # Some draws make a part that falls apart (a hole through its edge); then the next draw counts.
        for attempt in range(20):
            solid = FAMILIES[family](Draw(split, _seed(self.seed, name, attempt)))
            mesh = _mesh(solid)
            if mesh is not None:
                return Item(name, family, mesh)
        raise UserError(f"cad-parts could not make '{name}' in one piece")


def _seed(seed: int, name: str, attempt: int) -> int:
    return int.from_bytes(hashlib.sha256(f"{seed}/{name}/{attempt}".encode()).digest()[:8], "big")


def _mesh(solid: Manifold) -> trimesh.Trimesh | None:
    """The solid's surface; None unless it is one piece.

    Crumbs that a cut leaves behind are dropped, since no workshop delivers them.
    """
    pieces = sorted(solid.decompose(), key=lambda piece: -piece.volume())
    if not pieces or pieces[0].volume() < 0.97 * solid.volume():
        return None
    surface = pieces[0].simplify(SLIVER).to_mesh()
    vertices = np.round(np.asarray(surface.vert_properties, np.float64)[:, :3] / GRID) * GRID
    mesh = trimesh.Trimesh(vertices, np.asarray(surface.tri_verts, np.int64), process=False)
    return mesh if mesh.is_watertight and mesh.volume > 0 else None
