"""The surface of a field as a solid: surface nets, on a grid that is fine only near the surface.

`manifold3d.Manifold.level_set` would ask Python for each of some 500,000 values.
"""

from functools import cache

import numpy as np
from jaxtyping import Bool, Float, Int
from manifold3d import Manifold, Mesh64

from pcsr_plugins.shapes.blobs.sdf import Field

REACH = 100.0
"""Bodies lie within a cube of twice this side around the origin, in mm."""

SEARCH = 8.0
"""The step of the grid, in mm, on which a body's bounds and area are looked for: somewhere a body is twice as thick."""

STEEPEST = 1.6
"""How fast a field may change, in mm for each mm: bends and ripples stretch distances."""

TRIANGLES = 16_000
"""Approximate number of triangles of a body's mesh."""

HALVINGS = 2
"""How often the grid is refined; each time only near the surface."""

CORNERS = tuple(np.ndindex(2, 2, 2))
"""Of a cell, in the order of their bits."""

SHEETS = 4
"""At most as many pass through one cell."""

PROJECTIONS = 2
"""Newton steps, all along one gradient, that bring vertices from the middle of their cells onto the surface."""


def solid_of(field: Field) -> Manifold:
    """The body where the field is negative; empty if there is none, not a manifold if its mesh touches itself."""
    low, high, step = _extent(field)
    if step == 0:
        return Manifold()
    steps = 2**HALVINGS * step
    counts = np.ceil((high - low) / steps).astype(int) + 1
    values = field(low + steps * np.indices(counts).reshape(3, -1).T).reshape(counts)
    for _ in range(HALVINGS):
        values, low = _refined(field, values, low, steps)
        steps /= 2
    vertices, faces = surface_net(values)
    return Manifold(Mesh64(_projected(field, low + step * vertices, step), faces.astype(np.uint64)))


def _extent(field: Field) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"], float]:
    """Two corners of a box around the body, and the step of a grid that gives it about `TRIANGLES`; 0 without a body.

    An edge of the grid that crosses the surface becomes two triangles. Their number depends on the area alone,
    so that a coarse grid shows it.
    """
    axis = np.linspace(-REACH, REACH, int(2 * REACH / SEARCH) + 1)
    values = field(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3))
    values = values.reshape(3 * [len(axis)])
    crossings = sum(int(np.diff(values < 0, axis=a).sum()) for a in range(3))
    if not crossings:
        return np.zeros(3), np.zeros(3), 0.0
    corners = axis[np.argwhere(_close(values, SEARCH))]
    return (
        corners.min(axis=0) - SEARCH,
        corners.max(axis=0) + SEARCH,
        SEARCH * float(np.sqrt(2 * crossings / TRIANGLES)),
    )


def _close(values: Float[np.ndarray, "x y z"], step: float) -> Bool[np.ndarray, "x y z"]:
    """Where the surface may be half a step away, in all three directions."""
    return np.asarray(values < STEEPEST * step * np.sqrt(3) / 2)


def _refined(
    field: Field, values: Float[np.ndarray, "x y z"], low: Float[np.ndarray, "3"], step: float
) -> tuple[Float[np.ndarray, "x2 y2 z2"], Float[np.ndarray, "3"]]:
    """Each cell of the grid split into eight, and where they start; far from the surface values stay as they were."""
    low = low - step / 4
    close = _close(np.abs(values), step)
    for a in range(3):
        values, close = np.repeat(values, 2, axis=a), np.repeat(close, 2, axis=a)
    values[close] = field(low + step / 2 * np.argwhere(close))
    return values, low


def surface_net(values: Float[np.ndarray, "x y z"]) -> tuple[Float[np.ndarray, "v 3"], Int[np.ndarray, "f 3"]]:
    """The zero level of values on a grid, in steps of the grid, outwards where they are positive.

    A vertex for each sheet of surface through a cell, amid the crossings of the cell's edges; two triangles for each
    edge that is crossed, between the four cells around it (Gibson, Constrained Elastic Surface Nets, 1998; a vertex
    for each sheet: Nielson, Dual Marching Cubes, 2004). The border of the grid must lie outside.
    """
    inside = values < 0
    strides = np.array([values.shape[1] * values.shape[2], values.shape[2], 1])
    signs = sum(
        inside[i : i - 1 or None, j : j - 1 or None, k : k - 1 or None] << n for n, (i, j, k) in enumerate(CORNERS)
    )
    signs = np.pad(np.asarray(signs), [(0, 1)] * 3).ravel()
    quads, crossings = [], []
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        at = np.argwhere(np.diff(inside, axis=a))
        first = at @ strides
        here, there = values.ravel()[first], values.ravel()[first + strides[a]]
        crossing = at.astype(float)
        crossing[:, a] += here / (here - there)
        beside = np.array([(1, 1), (0, 1), (0, 0), (1, 0)])
        cells = first[:, None] - beside @ strides[[b, c]]
        sheets = _sheets()[signs[cells], 4 * a + beside @ (2, 1)]
        around = cells * SHEETS + sheets
        quads.append(np.where((here < 0)[:, None], around, around[:, ::-1]))
        crossings.append(crossing)
    _, corners = np.unique(np.concatenate(quads), return_inverse=True)
    corners = corners.reshape(-1, 4)
    each = np.repeat(np.concatenate(crossings), 4, axis=0)
    count = np.bincount(corners.ravel())
    vertices = np.stack([np.bincount(corners.ravel(), each[:, a]) / count for a in range(3)], axis=1)
    return vertices, _triangles(vertices, corners)


@cache
def _sheets() -> Int[np.ndarray, "256 12"]:
    """Which sheet crosses an edge of a cell, by the signs at the cell's corners.

    Bit 4x + 2y + z of the signs is the corner (x, y, z); edge 4a + 2b + c runs along axis a, b and c being its place
    along the next two. Two edges of a face belong to one sheet if no other is crossed. Where all four are, the sheets
    go around the two corners that are inside: the same for both cells that share the face.
    """
    edges = {}
    for a in range(3):
        for n, (b, c) in enumerate(np.ndindex(2, 2)):
            ends = [np.roll((end, b, c), a) for end in (0, 1)]
            edges[frozenset(int(end @ (4, 2, 1)) for end in ends)] = 4 * a + n
    faces = [
        [int(np.roll((side, b, c), a) @ (4, 2, 1)) for b, c in ((0, 0), (0, 1), (1, 1), (1, 0))]
        for a in range(3)
        for side in (0, 1)
    ]
    table = np.tile(np.arange(12), (256, 1))
    for signs, sheet in enumerate(table):
        for face in faces:
            around = [edges[frozenset((face[i - 1], face[i]))] for i in range(4)]  # edge i ends at corner i
            isin = [signs >> corner & 1 for corner in face]
            crossed = [edge for i, edge in enumerate(around) if isin[i - 1] != isin[i]]
            pairs = [(around[i], around[i - 3]) for i in range(4) if isin[i]] if len(crossed) == 4 else [crossed]
            for one, two in filter(None, pairs):
                sheet[sheet == sheet[two]] = sheet[one]
        crossed = [edge for ends, edge in edges.items() if len({signs >> end & 1 for end in ends}) == 2]
        sheet[crossed] = np.unique(sheet[crossed], return_inverse=True)[1]
    return table


def _triangles(vertices: Float[np.ndarray, "v 3"], quads: Int[np.ndarray, "q 4"]) -> Int[np.ndarray, "f 3"]:
    """Each quadrilateral cut along the shorter of its diagonals."""
    one, two = (np.linalg.norm(vertices[quads[:, i]] - vertices[quads[:, i + 2]], axis=1) for i in (0, 1))
    quads = np.where((one <= two)[:, None], quads, np.roll(quads, -1, axis=1))
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def _projected(field: Field, vertices: Float[np.ndarray, "v 3"], step: float) -> Float[np.ndarray, "v 3"]:
    """Moved along the gradient to where the field is zero, by half a grid step at most."""
    small = step / 100
    values = field(vertices)
    slope = np.stack([(field(vertices + small * axis) - values) / small for axis in np.eye(3)], axis=1)
    slope /= np.maximum((slope**2).sum(axis=1, keepdims=True), 0.1)
    moved = vertices
    for again in range(PROJECTIONS):
        moved = moved - (field(moved) if again else values)[:, None] * slope
    shift = moved - vertices
    length = np.linalg.norm(shift, axis=1, keepdims=True)
    return np.asarray(vertices + shift * np.minimum(1, step / 2 / np.maximum(length, 1e-12)))
