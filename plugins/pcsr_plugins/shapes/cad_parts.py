"""Shapes `cad-parts`: mechanical parts generated on the spot. No download, the same on every machine.

The embedded stand-in for the ABC objects of TSR-PD (TAPSR, Sec. 4.1). Lengths are millimetres. What they lack
beside real parts is in docs/shapes.md.
"""

import hashlib
from collections.abc import Callable, Sequence

import numpy as np
import trimesh
from jaxtyping import Int
from manifold3d import Manifold

from pcsr import Item, Shapes, UserError
from pcsr_plugins.shapes.families import (
    blocks,
    fasteners,
    moulded,
    pipes,
    plates,
    stock,
    toothed,
    turned_parts,
)
from pcsr_plugins.shapes.families.draw import SPLITS, Draw
from pcsr_plugins.shapes.soundness import check_mesh

_FUNCTIONS: tuple[Callable[[Draw], Manifold], ...] = (
    *(plates.adapter, plates.bracket, plates.buckle, plates.flange, plates.gasket, plates.hinge),
    *(plates.plate, plates.sheet_bracket),
    *(blocks.arch, blocks.clamp, blocks.heat_sink, blocks.housing, blocks.joint, blocks.lever),
    *(blocks.machined_block, blocks.manifold_block, blocks.pillow_block),
    *(fasteners.bolt, fasteners.chain_link, fasteners.clip, fasteners.hook, fasteners.nut),
    *(fasteners.spring, fasteners.stand_off),
    *(moulded.pad, moulded.spanner, moulded.tray),
    *(pipes.duct, pipes.elbow, pipes.tee, pipes.valve),
    *(stock.circlip, stock.profile, stock.rod, stock.washer),
    *(toothed.cam, toothed.gear, toothed.impeller, toothed.ratchet, toothed.sprocket),
    *(turned_parts.bearing, turned_parts.bushing, turned_parts.handwheel, turned_parts.knob),
    *(turned_parts.lamp_post, turned_parts.nozzle, turned_parts.pulley, turned_parts.shaft),
)
FAMILIES = {f.__name__.replace("_", "-"): f for f in sorted(_FUNCTIONS, key=lambda f: f.__name__)}
"""By name, in the alphabet's order: the first few families then come from several workshops."""

GRID = 1e-5
"""Vertices are rounded to this, in mm: the last bits of sines differ between machines."""

SLIVER = 2e-3
"""Edges shorter than this, in mm, are collapsed: they are left over where cuts almost meet."""

FLATTEST = 1e-9
"""The smallest face that a part may have, in mm²: a rounding error of the grid is about as large."""

ATTEMPTS = 20
"""Draws tried for a part: some make one that falls apart, by a hole through its edge for example."""


class CadParts(Shapes):
    """Families of parts in turn, each part of a family different."""

    version = 1

    def __init__(self, *, count: int = 1600, held_out: int = 96, seed: int = 0) -> None:
        """Choose how many.

        Args:
            count: training parts.
            held_out: validation parts, and as many test parts.
            seed: another seed, other parts.

        Raises:
            UserError: a number of parts is negative.
        """
        if min(count, held_out) < 0:
            raise UserError(f"cad-parts: count {count} and held_out {held_out} must not be negative")
        self.counts = {"train": count, "validation": held_out, "test": held_out}
        self.seed = seed

    def names(self, split: str) -> Sequence[str]:
        """``split/family/number``, families in turn.

        Raises:
            UserError: an unknown split.
        """
        if split not in self.counts:
            raise UserError(f"cad-parts has no split '{split}': it has {', '.join(self.counts)}")
        rounds, families = len(FAMILIES), list(FAMILIES)
        return [f"{split}/{families[i % rounds]}/{i // rounds:04d}" for i in range(self.counts[split])]

    def item(self, name: str) -> Item:
        """Generate one part: one watertight body, in mm.

        Raises:
            UserError: `name` is not one of `names`.
        """
        split, _, rest = name.partition("/")
        family, _, number = rest.partition("/")
        if split not in SPLITS or family not in FAMILIES or not number.isdecimal():
            raise UserError(f"cad-parts has no part '{name}': parts are called split/family/number")
        if int(number) * len(FAMILIES) + list(FAMILIES).index(family) >= self.counts[split]:
            raise UserError(f"cad-parts has no part '{name}' among {self.counts[split]} of '{split}': ask for more")
        for attempt in range(ATTEMPTS):
            mesh = _mesh(FAMILIES[family](Draw(split, _seed(self.seed, name, attempt))))
            if mesh is not None:
                return Item(name, family, check_mesh(mesh, name))
        raise UserError(f"cad-parts could not make '{name}' in one piece with seed {self.seed}: take another seed")

    def digest(self, name: str) -> str:
        """The seed: with the version and the name it says which part that is."""
        return f"seed {self.seed}"


def _seed(seed: int, name: str, attempt: int) -> int:
    return int.from_bytes(hashlib.sha256(f"{seed}/{name}/{attempt}".encode()).digest()[:8], "big")


def _mesh(solid: Manifold) -> trimesh.Trimesh | None:
    """The solid's surface; None unless it is sound and one piece.

    Crumbs that a cut leaves behind are dropped, since no workshop delivers them.
    """
    pieces = sorted(solid.decompose(), key=lambda piece: -piece.volume())
    if not pieces or pieces[0].volume() < 0.97 * solid.volume():
        return None
    surface = pieces[0].simplify(SLIVER).to_mesh64()
    vertices, corners = np.unique(
        np.round(np.asarray(surface.vert_properties)[:, :3] / GRID), axis=0, return_inverse=True
    )
    faces = _without_folds(corners.reshape(-1)[np.asarray(surface.tri_verts, np.int64)])
    mesh = trimesh.Trimesh(vertices * GRID, faces, process=False)
    return mesh if _sound(mesh) else None


def _sound(mesh: trimesh.Trimesh) -> bool:
    """One watertight body, turned the right way out, without flat faces."""
    closed = mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
    return bool(closed and mesh.body_count == 1 and mesh.area_faces.min() > FLATTEST)


def _without_folds(faces: Int[np.ndarray, "f 3"]) -> Int[np.ndarray, "g 3"]:
    """Without what rounding flattened: faces of two equal corners, and pairs of faces back to back."""
    first = faces.argmin(axis=1)[:, None]
    faces = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    places = (faces.max() + 1) ** np.arange(3)
    return faces[~np.isin(faces @ places, faces[:, [0, 2, 1]] @ places)]
