"""Moulded and forged parts: few edges are sharp and few outlines symmetric."""

from manifold3d import CrossSection, Manifold

from pcsr_plugins.shapes.cad_parts.solids import (
    ROUND,
    SMALL,
    along_x,
    along_y,
    box,
    cylinder,
    extrude,
    grid_of,
    hole,
    rectangle,
    rounded,
    union,
)
from pcsr_plugins.shapes.shared.draw import Draw


def tray(draw: Draw) -> Manifold:
    """A shallow plastic tray of irregular outline: a rim, ribs crossing its floor, bosses, and cut-outs."""
    a, b, h, wall = draw(50, 90), draw(35, 60), draw(6, 16), draw(1.4, 2.6)
    outline = rectangle(a, b)
    bite = rectangle(draw(0.2, 0.4) * a, draw(0.25, 0.45) * b)
    for x, y in ((-1, 1), (1, 1), (1, -1))[: draw.whole(0, 3)]:
        outline -= bite.translate((x * a / 2, y * b / 2))
    outline = rounded(outline, draw(2, 5), draw(2, 5))
    inside = outline.offset(-wall)
    body = extrude(outline, h) - extrude(inside, h).translate((0, 0, wall))
    tall = draw(0.35, 0.9) * h
    along, across = draw.whole(0, 3), draw.whole(0, 2)
    ribs = [box(0.8 * wall, b, tall).translate((draw(-0.45, 0.45) * a, 0, 0)) for _ in range(along)]
    ribs += [box(a, 0.8 * wall, tall).translate((0, draw(-0.4, 0.4) * b, 0)) for _ in range(across)]
    positions = [(draw(-0.38, 0.38) * a, draw(-0.36, 0.36) * b) for _ in range(draw.whole(2, 5))]
    boss = draw(2.2, 3.6)
    ribs += [grid_of(cylinder(boss, draw(0.4, 0.95) * h, SMALL), positions)]
    body += union(ribs) ^ extrude(outline.offset(-0.3 * wall), h)
    body -= grid_of(hole(0.45 * boss, h), positions)
    if draw.maybe():
        window = extrude(rectangle(draw(0.12, 0.3) * a, draw(0.15, 0.4) * b, 2), 3 * wall)
        body -= window.translate((draw(-0.2, 0.2) * a, draw(-0.15, 0.15) * b, -wall))
    if draw.maybe():
        notch = along_y(extrude(rectangle(draw(6, 14), h, 1), b)).translate((draw(-0.2, 0.2) * a, 0, h))
        body -= notch
    return body


def pad(draw: Draw) -> Manifold:
    """A block or disc without a sharp edge: a cushion, foot or handle, with a bore, groove or dent."""
    a, b, h, r = draw(18, 40), draw(16, 36), draw(14, 34), draw(2.5, 7)
    ball = Manifold.sphere(r, SMALL)
    kind = draw.one_of(["block", "wedge", "disc", "ball"])
    if kind == "ball":
        r = 0.6 * a
        body = Manifold.sphere(r, ROUND).scale((1, draw(0.75, 1), draw(0.6, 1))) - box(3 * r, 3 * r, r).translate(
            (0, 0, -r - draw(0.3, 0.55) * r)
        )
        h = r
    elif kind == "disc":
        ring = Manifold.revolve(CrossSection.circle(r, SMALL).translate((a / 2 - r / 2, 0)), ROUND)
        body = union([ring, ring.scale((draw(0.6, 1), 1, 1)).translate((0, 0, draw(0.1, 0.7) * h))]).hull()
    else:
        shrink = draw(0.3, 0.9) if kind == "wedge" else 1.0
        body = union(
            ball.translate((x * a / 2 * (shrink if z else 1), y * b / 2, z * h))
            for x in (-1, 1)
            for y in (-1, 1)
            for z in (0, 1)
        ).hull()
    finish = draw.one_of(["none", "bore", "blind", "groove", "dent"])
    if finish == "bore":
        body -= cylinder(draw(2.5, 5), 4 * h, SMALL).translate((0, 0, -2 * h))
    elif finish == "blind":
        body -= cylinder(draw(3, 6), 4 * h, SMALL).translate((draw(-0.15, 0.15) * a, 0, draw(0.3, 0.6) * h))
    elif finish == "groove":
        body -= along_x(extrude(rectangle(draw(6, 10), draw(3, 6), 1.2), 4 * a)).translate((-2 * a, 0, h + r))
    elif finish == "dent":
        body -= Manifold.sphere(0.9 * a, ROUND).translate((0, 0, h + r + draw(0.55, 0.75) * a))
    return body


def spanner(draw: Draw) -> Manifold:
    """A spanner: an open jaw or a ring at each end of a webbed shank."""
    length, size, t = draw(45, 90), draw(8, 16), draw(3.5, 7)
    shank = rectangle(length, draw(0.8, 1.2) * size, 1.5).translate((length / 2, 0))
    body = extrude(rounded(shank, 1), 0.75 * t).translate((0, 0, 0.125 * t))
    if draw.maybe():
        web = extrude(rectangle(0.6 * length, 0.45 * size, 0.2 * size), t).translate((length / 2, 0, 0.65 * t))
        body -= web
        body -= web.translate((0, 0, -1.3 * t))
    cuts = []
    for end, scale in ((0, 1.0), (1, draw(0.75, 1.25))):
        s = size * scale
        place = (end * length, 0, 0)
        if draw.maybe():
            head, gap = CrossSection.circle(1.15 * s, ROUND), extrude(rectangle(3 * s, s, 0.1), 3 * t)
            gap = gap.translate((1.5 * s - 0.35 * s, 0, -t)).rotate((0, 0, draw(-20, 20) + (0 if end else 180)))
        else:
            head = CrossSection.circle(0.95 * s, ROUND)
            gap = cylinder(0.58 * s, 3 * t, 6).translate((0, 0, -t))
            if draw.maybe():
                gap += gap.rotate((0, 0, 30))
        body += extrude(head, t).translate(place)
        cuts.append(gap.translate(place))
    return body - union(cuts)
