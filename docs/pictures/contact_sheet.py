"""Draw one part of each family, lit from above, as a PNG: how the picture of docs/shapes.md is made.

python docs/pictures/contact_sheet.py docs/pictures/cad-parts.png
"""

import struct
import sys
import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh
from jaxtyping import Float, UInt8

from pcsr_plugins.shapes.cad_parts import FAMILIES, CadParts

BEHIND = 3
"""Rays for a pixel, each way: their mean softens edges."""


def picture(mesh: trimesh.Trimesh, size: int) -> Float[np.ndarray, "size size"]:
    """Brightness, 1 where nothing is hit: a parallel view from the front, right and above."""
    turn = trimesh.geometry.align_vectors((1.0, -1.4, 0.9), (0, 0, 1))
    up = turn[:3, :3] @ (0, 0, 1)
    turn = trimesh.transformations.rotation_matrix(np.arctan2(up[0], up[1]), (0, 0, 1)) @ turn
    seen = mesh.copy().apply_transform(turn)
    seen.apply_translation(-seen.bounds.mean(axis=0))
    fine = size * BEHIND
    edge = 0.54 * seen.extents[:2].max()
    steps = (np.arange(fine) + 0.5) / fine * 2 - 1
    x, y = np.meshgrid(steps * edge, -steps * edge)
    origins = np.stack([x.ravel(), y.ravel(), np.full(fine**2, seen.extents.max())], axis=1)
    faces = seen.ray.intersects_first(origins, np.tile((0.0, 0.0, -1.0), (fine**2, 1)))
    light = np.array((-0.45, 0.6, 0.66))
    shade = 0.25 + 0.65 * np.clip(seen.face_normals @ light, 0, 1)
    pixels = np.where(faces < 0, 1.0, shade[faces]).reshape(size, BEHIND, size, BEHIND)
    return np.asarray(pixels.mean(axis=(1, 3)))


def sheet(meshes: Sequence[trimesh.Trimesh], columns: int, size: int) -> Float[np.ndarray, "h w"]:
    """Row after row of pictures."""
    pictures = [picture(mesh, size) for mesh in meshes]
    pictures += [np.ones((size, size))] * (-len(meshes) % columns)
    return np.vstack([np.hstack(pictures[i : i + columns]) for i in range(0, len(pictures), columns)])


def png(image: Float[np.ndarray, "h w"]) -> bytes:
    """An image as a PNG file, in 32 greys: more would not show, and would not compress."""
    grey: UInt8[np.ndarray, "h w"] = np.round(255 * image).astype(np.uint8) // 8 * 8 + 7
    rows = np.pad(grey, ((0, 0), (1, 0))).tobytes()  # each row begins with its filter: none

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", grey.shape[1], grey.shape[0], 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")


if __name__ == "__main__":
    shapes = CadParts()
    names = sorted(shapes.names("train")[: 2 * len(FAMILIES)])  # two of each family, side by side
    parts = [shapes.item(name).mesh for name in names]
    Path(sys.argv[1]).write_bytes(png(sheet(parts, columns=12, size=96)))
