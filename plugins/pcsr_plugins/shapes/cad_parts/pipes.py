"""Pipe fittings and ducts."""

import numpy as np
from manifold3d import CrossSection, Manifold

from pcsr_plugins.shapes.cad_parts.solids import (
    SMALL,
    along_x,
    cylinder,
    hole,
    ring_of,
    swept,
    turned,
    union,
)
from pcsr_plugins.shapes.shared.draw import Draw, Number


def _end(draw: Draw, outer: Number, kind: str) -> Manifold:
    """The end of a pipe that leaves along +z and ends at z = 0, its bore still to be cut."""
    if kind == "collar":
        return cylinder(outer + draw(1.5, 3.5), draw(5, 9)).translate((0, 0, -5))
    if kind == "flange":
        rim, t = outer + draw(6, 11), draw(2.5, 5)
        bolts = ring_of(hole(draw(1.2, 2), t), draw.whole(4, 8), rim - 3.2)
        return (cylinder(rim, t) - bolts).translate((0, 0, -t))
    return Manifold()


def tee(draw: Draw) -> Manifold:
    """A T or a cross of pipes, plain, collared or flanged."""
    outer = draw(8, 15)
    bore, reach, up = outer - draw(1.8, 4), draw(20, 36), draw(16, 36)
    branch = outer * draw(0.65, 1.0)
    branch_bore = max(branch - draw(1.8, 3), 0.4 * branch)
    kind = draw.one_of(["plain", "collar", "flange"])
    end, branch_end = _end(draw, outer, kind), _end(draw, branch, kind)
    run = cylinder(outer, 2 * reach).translate((0, 0, -reach)) + end.translate((0, 0, reach))
    run += end.rotate((180, 0, 0)).translate((0, 0, -reach))
    arm = cylinder(branch, up) + branch_end.translate((0, 0, up))
    arm_bore = cylinder(branch_bore, up + 10)
    body, bores = (
        run + along_x(arm),
        cylinder(bore, 2 * reach + 20).translate((0, 0, -reach - 10)) + along_x(arm_bore),
    )
    if draw.maybe(0.3):
        body, bores = body + along_x(arm).rotate((0, 0, 180)), bores + along_x(arm_bore).rotate((0, 0, 180))
    return body - bores


def elbow(draw: Draw) -> Manifold:
    """A bend of 45 to 180 degrees between straight ends."""
    outer = draw(6, 13)
    bore, bend = outer - draw(1.5, 3.5), outer * draw(1.5, 2.8)
    angle, length = draw.one_of([45.0, 60.0, 90.0, 90.0, 180.0]), draw(6, 22)
    tail = length if draw.maybe(0.75) else 1.0
    end = _end(draw, outer, draw.one_of(["plain", "collar", "flange"]))

    # Straight along +z to the origin's height, then around the y axis.
    t = np.radians(np.linspace(0, angle, int(angle / 4)))
    curve = np.stack([bend - bend * np.cos(t), 0 * t, bend * np.sin(t)], axis=1)
    direction = np.array([np.sin(t[-1]), 0, np.cos(t[-1])])

    def pipe(radius: Number, over: Number) -> Manifold:
        path = np.concatenate([[[0, 0, -length - over]], curve, [curve[-1] + direction * (tail + over)]])
        return swept(path, radius, segments=48)

    body = pipe(outer, 0) + end.rotate((180, 0, 0)).translate((0, 0, -length))
    if tail == length:
        body += end.rotate((0, angle, 0)).translate(tuple(map(float, curve[-1] + direction * tail)))
    return body - pipe(bore, 8)


def valve(draw: Draw) -> Manifold:
    """A valve body: a bulge on a pipe, a bonnet with a stem and a wheel."""
    outer, reach = draw(7, 11), draw(20, 32)
    bore = outer - draw(1.6, 3)
    kind = draw.one_of(["collar", "flange"])
    end = _end(draw, outer, kind)
    body = cylinder(outer, 2 * reach).translate((0, 0, -reach)) + end.translate((0, 0, reach))
    body += end.rotate((180, 0, 0)).translate((0, 0, -reach))
    body += Manifold.sphere(outer * draw(1.25, 1.6), 48)
    body -= cylinder(bore, 2 * reach + 20).translate((0, 0, -reach - 10))
    up, stem, wheel = draw(14, 22), draw(1.8, 3), draw(9, 17)
    bonnet = turned([(0, 0.9 * outer), (0.75 * outer, 0.9 * outer), (0.6 * outer, up), (0, up)], 0.4)
    bonnet += cylinder(stem, draw(10, 18), SMALL).translate((0, 0, up - 1))
    top = up + 8
    rim = Manifold.revolve(CrossSection.circle(draw(1.2, 2), 20).translate((wheel, 0)), 56).translate((0, 0, top))
    spoke = along_x(cylinder(1.2, wheel, 20)).translate((0, 0, top))
    bonnet += rim + union(spoke.rotate((0, 0, 120 * i)) for i in range(3))
    return body + along_x(bonnet)


def duct(draw: Draw) -> Manifold:
    """A thin-walled reducer between a square and a round opening, or two round ones."""
    r1, r2, h, wall = draw(12, 24), draw(7, 14), draw(18, 36), draw(1.5, 2.8)
    sides = 4 if draw.maybe() else 64
    shift = draw(-8, 8) if draw.maybe() else 0.0

    def loft(grow: Number, low: Number, high: Number) -> Manifold:
        bottom = cylinder(r1 + grow, 2, sides).rotate((0, 0, 45)).translate((0, 0, low))
        top = cylinder(r2 + grow, 2, 64).translate((shift, 0, high - 2))
        return (bottom + top).hull()

    foot = cylinder(r1 + draw(3, 7), draw(2, 3.5), sides).rotate((0, 0, 45))
    body = loft(0, 0, h) + foot
    if draw.maybe():
        body += cylinder(r2 + draw(1.5, 3), 4).translate((shift, 0, h - 4))
    return body - loft(-wall, -1, h + 1)
