"""Parts cut from plate or bent from sheet."""

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold

from pcsr_plugins.shapes.cad_parts.solids import (
    SMALL,
    along_x,
    along_y,
    box,
    chamfered,
    cylinder,
    extrude,
    grid_of,
    hole,
    polygon,
    rectangle,
    ring_of,
    rounded,
    tube,
    union,
)
from pcsr_plugins.shapes.shared.draw import Draw


def plate(draw: Draw) -> Manifold:
    """A mounting plate: corner holes, perhaps a window, a boss or stiffening ribs."""
    a, b, t = draw(50, 100), draw(30, 70), draw(1, 8)
    body = chamfered(rectangle(a, b, draw(2, 10)), t, draw(0.3, 1.2))
    r, inset = draw(1.8, 4), draw(6, 9)
    corners = [(x, y) for x in (-a / 2 + inset, a / 2 - inset) for y in (-b / 2 + inset, b / 2 - inset)]
    body -= grid_of(hole(r, t, draw(0.5, 1.5) if draw.maybe() else 0), corners)
    if draw.maybe():
        body -= extrude(rectangle(draw(0.25, 0.5) * a, draw(0.25, 0.5) * b, draw(2, 5)), t + 2).translate((0, 0, -1))
    else:
        boss = draw(0.14, 0.22) * b
        body += cylinder(boss, t + draw(4, 15))
        body -= hole(0.55 * boss, t + 20)
    if draw.maybe():
        rib = box(0.7 * a, draw(1.5, 3), draw(4, 10)).translate((0, 0, 0.9 * t))
        body += grid_of(rib, [(0, -0.36 * b), (0, 0.36 * b)])
    return body


def adapter(draw: Draw) -> Manifold:
    """A plate around scattered bosses, drilled at each, perhaps with ribs to the largest."""
    t, wall, count = draw(2.5, 6), draw(2, 4), draw.whole(3, 6)
    spread, turn = draw(18, 38), draw(0, 2 * np.pi)
    positions, radii = [(0.0, 0.0)], [draw(6, 13)]
    for i in range(count):
        angle = turn + 2 * np.pi * (i + draw(-0.3, 0.3)) / count
        reach = spread * draw(0.6, 1.15)
        positions.append((float(reach * np.cos(angle)), float(reach * np.sin(angle))))
        radii.append(draw(1.6, 4))
    discs = [CrossSection.circle(r + wall, SMALL).translate(p) for r, p in zip(radii, positions, strict=True)]
    arms = [CrossSection.batch_hull([discs[0], disc]) for disc in discs[1:]]
    outline = CrossSection.batch_hull(discs) if draw.maybe(0.4) else arms[0]
    for arm in arms:
        outline += arm
    body = extrude(rounded(outline, 0.5, draw(2, 6)), t)
    heights = [t + draw(2, 14) if draw.maybe() else t for _ in positions]
    ribbed = draw.maybe()
    for (x, y), disc, height in zip(positions, discs, heights, strict=True):
        if height > t:
            body += extrude(disc.offset(-0.1 * wall), height)
        if ribbed and (x, y) != (0, 0):
            rib = box(float(np.hypot(x, y)), draw(1.5, 2.5), t + 0.5 * (min(height, heights[0]) - t) + 1)
            body += rib.translate((float(np.hypot(x, y)) / 2, 0, 0)).rotate((0, 0, float(np.degrees(np.arctan2(y, x)))))
    for (x, y), r, height in zip(positions, radii, heights, strict=True):
        body -= hole(r, height, draw(0, 1.2)).translate((x, y, 0))
    return body


def bracket(draw: Draw) -> Manifold:
    """An angle bracket: two flanges with holes or slots, filleted in the corner, perhaps with a gusset."""
    a, b, width, t = draw(30, 70), draw(30, 80), draw(20, 50), draw(2, 6)
    corner = polygon([(0, 0), (a, 0), (a, t), (t, t), (t, b), (0, b)])
    corner = rounded(corner, 0.3 * t, draw(1, 5))
    body = along_y(extrude(corner, width)).translate((0, width / 2, 0))
    r = draw(1.6, 0.12 * width)
    holes = draw.whole(1, 2)
    for i in range(holes):
        y = (i - (holes - 1) / 2) * 0.5 * width
        x, z = draw(0.6, 0.72) * a, draw(0.6, 0.72) * b
        if draw.maybe():
            slot = extrude(rectangle(4 * r, 2 * r, r), 2 * t + 2).translate((x, y, -1))
        else:
            slot = hole(r, 2 * t).translate((x, y, 0))
        body -= slot
        body -= along_x(hole(r, 2 * t)).translate((-1, y, z))
    if draw.maybe():
        leg = draw(0.35, 0.6)
        gusset = along_y(extrude(polygon([(0.5 * t, 0.5 * t), (leg * a, 0.5 * t), (0.5 * t, leg * b)]), draw(2, 4)))
        positions = [0.0] if holes == 2 or draw.maybe() else [-0.42 * width, 0.42 * width]
        body += union(gusset.translate((0, y + 1.5, 0)) for y in positions)
    return body


def flange(draw: Draw) -> Manifold:
    """A pipe flange with a bolt circle, a raised face and often a tapered hub."""
    bore, t = draw(8, 20), draw(4, 10)
    outer = bore + draw(15, 30)
    body = chamfered(CrossSection.circle(outer, 96), t, draw(0.3, 1.5))
    body += cylinder(bore + draw(4, 8), t + draw(0.8, 2.5))
    if draw.maybe(0.6):
        hub = bore + draw(3, 6)
        body += cylinder(hub + draw(0.5, 4), draw(10, 30), top=hub).rotate((180, 0, 0)).translate((0, 0, 1))
    r = draw(1.5, 3.5)
    circle = (outer + bore + 6) / 2 + draw(0, 2)
    body -= ring_of(hole(r, t + 4), draw.whole(3, 10), min(circle, outer - r - 1.5))
    return body - cylinder(bore, 100).translate((0, 0, -50))


def hinge(draw: Draw) -> Manifold:
    """One leaf of a butt hinge with its knuckles."""
    width, length, t, pin = draw(40, 90), draw(20, 45), draw(2, 4), draw(1.5, 3.5)
    knuckle = pin + draw(1.2, 2.5)
    leaf = extrude(rectangle(width, length, draw(1, 5)), t).translate((0, length / 2 + knuckle * 0.6, 0))
    inset = draw(6, 9)
    rows = draw.whole(1, 2)
    positions = [
        (x, length * (0.55 if rows == 1 else 0.35 + 0.4 * j) + knuckle)
        for j in range(rows)
        for x in (-width / 2 + inset, *([0] if draw.maybe() else []), width / 2 - inset)
    ]
    leaf -= grid_of(hole(draw(1.5, 2.5), t, draw(0.5, 1.2)), positions)
    count = draw.whole(2, 4)
    step = width / (2 * count - 1)
    barrel = along_x(cylinder(knuckle, step * 0.96)) + box(step * 0.96, knuckle * 1.4, t).translate(
        (step * 0.48, knuckle * 0.7, -knuckle)
    )
    knuckles = union(barrel.translate((-width / 2 + 2 * step * i, 0, knuckle)) for i in range(count))
    bore = along_x(cylinder(pin, width + 4, SMALL)).translate((-width / 2 - 2, 0, knuckle))
    return (leaf + knuckles) - bore


def buckle(draw: Draw) -> Manifold:
    """A strap buckle: a frame with one or two bars and, on some, a prong."""
    a, b, bar = draw(35, 70), draw(25, 50), draw(3, 6)
    t = draw(2.5, 5)
    frame = rectangle(a, b, draw(3, 10))
    frame -= frame.offset(-bar, JoinType.Miter)
    body = extrude(frame, t)
    positions = [0.0] if draw.maybe(0.6) else [-0.18 * a, 0.18 * a]
    for x in positions:
        body += along_y(cylinder(draw(1.2, 0.5 * t), b - bar, SMALL)).translate((x, (b - bar) / 2, t / 2))
    if draw.maybe():
        reach = a / 2 - bar / 2 - positions[0]
        body += along_x(cylinder(draw(1, 1.8), reach, SMALL)).translate((positions[0], 0, t * 0.9))
        body += along_y(tube(0.5 * t + 1.6, 0.4, draw(4, 7))).translate((positions[0], 2.5, t / 2))
    return body


def gasket(draw: Draw) -> Manifold:
    """A cylinder-head gasket: a thin outline with several bores, bolt holes and ears."""
    count, bore, t = draw.whole(1, 3), draw(10, 20), draw(0.4, 3)
    pitch = 2 * bore + draw(5, 10)
    length = pitch * count + draw(6, 14)
    width = 2 * bore + draw(14, 26)
    outline = rectangle(length, width, draw(3, 12))
    ear = draw(4, 7)
    if draw.maybe():
        for x in (-length / 2, length / 2):
            outline += CrossSection.circle(ear, SMALL).translate((x, 0))
            outline -= CrossSection.circle(0.45 * ear, SMALL).translate((x * 1.02, 0))
    for i in range(count):
        outline -= CrossSection.circle(bore, 64).translate(((i - (count - 1) / 2) * pitch, 0))
    inset = draw(3.5, 5)
    for i in range(count + 1):
        for y in (-width / 2 + inset, width / 2 - inset):
            x = (i - count / 2) * pitch
            x = max(-length / 2 + inset, min(length / 2 - inset, x))
            outline -= CrossSection.circle(draw(1.2, 2.2), SMALL).translate((x, y))
    return extrude(rounded(outline, 0.4), t)


def sheet_bracket(draw: Draw) -> Manifold:
    """Thin sheet bent into two to four flanges around a floor, punched in rows, its corners cut off."""
    a, b, t = draw(30, 70), draw(25, 55), draw(0.5, 1.8)
    body = extrude(rectangle(a, b, draw(1, 3)), t)
    pitch, r = draw(7, 12), draw(1, 2.4)
    sides = draw.one_of([(0, 90), (0, 180), (0, 90, 180), (0, 90, 180, 270), (0,)])
    for turn in sides:
        width, reach = (b, a) if turn % 180 == 0 else (a, b)
        height = draw(10, 45)
        width *= draw(0.5, 0.96)
        flange = polygon(
            [
                (-width / 2, 0),
                (width / 2, 0),
                (draw(0.25, 0.5) * width, height),
                (-draw(0.25, 0.5) * width, height),
            ],
            draw(1, 4),
        )
        flange += CrossSection.square((width, 0.3 * height)).translate((-width / 2, 0))
        rows, columns = draw.whole(0, 3), draw.whole(1, 3)
        for i in range(rows):
            for j in range(columns):
                place = ((j - (columns - 1) / 2) * min(pitch, 0.45 * width / columns), 6 + i * pitch)
                if place[1] < height - r - 1.5:
                    flange -= CrossSection.circle(r if columns == 1 else min(r, 0.15 * width / columns), 24).translate(
                        place
                    )
        leaf = extrude(flange, t).rotate((90, 0, 90)).translate((reach / 2 - t, 0, 0)).rotate((0, 0, turn))
        body += leaf
        if draw.maybe():  # the bend's inner radius
            bend = extrude(polygon([(0, 0), (0, 2 * t), (-2 * t, 0)]), 0.9 * width).rotate((90, 0, 0))
            body += bend.translate((reach / 2 - t, 0.45 * width, 0.9 * t)).rotate((0, 0, turn))
    count = draw.whole(0, 4)
    spots = [((i - (count - 1) / 2) * 0.8 * a / max(count, 2), draw(-0.3, 0.3) * b) for i in range(count)]
    return body - grid_of(hole(draw(1, 2.2), t), spots)
