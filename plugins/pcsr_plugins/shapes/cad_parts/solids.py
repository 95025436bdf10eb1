"""Solids of parts: rounded outlines, tubes, rings of holes, turned profiles, wires."""

from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float
from manifold3d import CrossSection, JoinType, Manifold, Mesh, OpType

from pcsr_plugins.shapes.shared.draw import Number

ROUND = 64
"""Segments of a large circle."""
SMALL = 32
"""Segments of a hole."""


def union(solids: Iterable[Manifold]) -> Manifold:
    """All of them together."""
    return Manifold.batch_boolean(list(solids), OpType.Add)


def rectangle(width: Number, height: Number, fillet: Number = 0.0) -> CrossSection:
    """Centred, with rounded corners."""
    fillet = min(fillet, 0.49 * width, 0.49 * height)
    if fillet <= 0:
        return CrossSection.square((width, height), True)
    inner = CrossSection.square((width - 2 * fillet, height - 2 * fillet), True)
    return inner.offset(fillet, JoinType.Round, circular_segments=SMALL)


def polygon(corners: Sequence[tuple[Number, Number]], fillet: Number = 0.0) -> CrossSection:
    """Corners to an outline, its convex corners rounded."""
    outline = CrossSection([list(corners)])
    return rounded(outline, fillet) if fillet > 0 else outline


def rounded(outline: CrossSection, fillet: Number, inner: Number = 0.0) -> CrossSection:
    """Round convex corners by `fillet`, concave ones by `inner`."""
    out = outline.offset(-fillet, JoinType.Miter).offset(fillet, JoinType.Round, circular_segments=SMALL)
    if inner > 0:
        out = out.offset(inner, JoinType.Miter).offset(-inner, JoinType.Round, circular_segments=SMALL)
    return out


def extrude(outline: CrossSection, height: Number) -> Manifold:
    """Up from z = 0."""
    return Manifold.extrude(outline, height)


def chamfered(outline: CrossSection, height: Number, chamfer: Number) -> Manifold:
    """A convex outline extruded, its top and bottom edges chamfered."""
    chamfer = min(chamfer, 0.4 * height)
    if chamfer <= 0:
        return extrude(outline, height)
    inner = extrude(outline.offset(-chamfer, JoinType.Miter), height)
    return (inner + extrude(outline, height - 2 * chamfer).translate((0, 0, chamfer))).hull()


def box(x: Number, y: Number, z: Number) -> Manifold:
    """Centred in x and y, standing on z = 0."""
    return Manifold.cube((x, y, z), True).translate((0, 0, z / 2))


def cylinder(radius: Number, height: Number, segments: int = ROUND, top: Number = -1.0) -> Manifold:
    """Standing on z = 0; a cone if `top` is another radius."""
    return Manifold.cylinder(height, radius, top, segments)


def along_x(solid: Manifold) -> Manifold:
    """What stood along z lies along x."""
    return solid.rotate((0, 90, 0))


def along_y(solid: Manifold) -> Manifold:
    """What stood along z lies along y (towards -y)."""
    return solid.rotate((90, 0, 0))


def tube(outer: Number, inner: Number, height: Number) -> Manifold:
    """A hollow cylinder standing on z = 0."""
    return cylinder(outer, height) - cylinder(inner, height + 2).translate((0, 0, -1))


def hole(radius: Number, depth: Number, sink: Number = 0.0) -> Manifold:
    """To subtract: from z = -1 to depth + 1, countersunk at the top by `sink`."""
    shaft = cylinder(radius, depth + 2, SMALL).translate((0, 0, -1))
    if sink <= 0:
        return shaft
    return shaft + cylinder(radius, sink + 0.01, SMALL, radius + sink + 0.01).translate((0, 0, depth - sink))


def ring_of(solid: Manifold, count: int, radius: Number, phase: Number = 0.0) -> Manifold:
    """Copies on a circle about z, each turned with it."""
    return union(solid.translate((radius, 0, 0)).rotate((0, 0, phase + 360 * i / count)) for i in range(count))


def grid_of(solid: Manifold, positions: Iterable[tuple[Number, Number]]) -> Manifold:
    """Copies at positions of the plane."""
    return union(solid.translate((x, y, 0)) for x, y in positions)


def turned(profile: Sequence[tuple[Number, Number]], fillet: Number = 0.0, segments: int = ROUND) -> Manifold:
    """A profile of (radius, z) corners revolved about z; its convex corners may be rounded."""
    outline = CrossSection([list(profile)])
    if outline.area() < 0 or not outline.num_vert():
        outline = CrossSection([list(reversed(profile))])
    if fillet > 0:
        # Rounding must not eat into the axis: only what is off the axis is rounded.
        outline = rounded(outline + outline.mirror((1, 0)), fillet)
    return Manifold.revolve(outline, segments)


def swept(path: Float[np.ndarray, "n 3"], radius: Number, *, closed: bool = False, segments: int = 16) -> Manifold:
    """A wire of round section along a path; flat ends unless it is closed."""
    n = len(path)
    tangent = np.roll(path, -1, 0) - np.roll(path, 1, 0)
    if not closed:
        tangent[0], tangent[-1] = path[1] - path[0], path[-1] - path[-2]
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.zeros_like(path)
    start = np.eye(3)[np.argmin(np.abs(tangent[0]))]
    normal[0] = start - tangent[0] * (start @ tangent[0])
    for i in range(1, n):  # carried along without twisting
        normal[i] = normal[i - 1] - tangent[i] * (normal[i - 1] @ tangent[i])
        normal[i] /= np.linalg.norm(normal[i])
    normal[0] /= np.linalg.norm(normal[0])
    side = np.cross(tangent, normal)
    angle = 2 * np.pi * np.arange(segments) / segments
    rings = path[:, None] + radius * (np.cos(angle)[:, None] * normal[:, None] + np.sin(angle)[:, None] * side[:, None])
    vertices = rings.reshape(-1, 3)
    faces = []
    for i in range(n if closed else n - 1):
        here, there = i * segments, ((i + 1) % n) * segments
        for j in range(segments):
            k = (j + 1) % segments
            faces += [(here + j, here + k, there + k), (here + j, there + k, there + j)]
    if not closed:
        vertices = np.concatenate([vertices, path[:1], path[-1:]])
        last = (n - 1) * segments
        for j in range(segments):
            k = (j + 1) % segments
            faces += [(n * segments, k, j), (n * segments + 1, last + j, last + k)]
    return Manifold(Mesh(vertices.astype(np.float32), np.array(faces, np.uint32)))


def arc(radius: Number, start: Number, end: Number, count: int = 33) -> list[tuple[float, float]]:
    """Points on a circle about the origin, angles in degrees."""
    return [(radius * float(np.cos(t)), radius * float(np.sin(t))) for t in np.radians(np.linspace(start, end, count))]
