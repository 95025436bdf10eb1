"""What is bought by the metre or the hundred: rods, extruded profiles, washers, retaining rings."""

import numpy as np
from manifold3d import CrossSection, JoinType, Manifold

from pcsr_plugins.shapes.cad_parts.solids import (
    ROUND,
    SMALL,
    along_y,
    chamfered,
    cylinder,
    extrude,
    hole,
    polygon,
    rectangle,
    rounded,
    swept,
    turned,
    union,
)
from pcsr_plugins.shapes.shared.draw import Draw


def rod(draw: Draw) -> Manifold:
    """A rod or tube, straight with chamfered ends, bent once or twice, or with a hook at its end."""
    r, length = draw(2, 6), draw(40, 90)
    kind = draw.one_of(["straight", "bent", "crank", "hooked"])
    wall = draw(0.25, 0.6) * r if draw.maybe(0.4) else 0.0
    if kind == "straight":
        r *= draw.one_of([1, 2, 4])
        c = draw(0.05, 0.15) * r
        body = turned([(0, 0), (r - c, 0), (r, c), (r, length - c), (r - c, length), (0, length)])
        if wall:
            body -= cylinder(0.75 * r, length + 2).translate((0, 0, -1))
        if draw.maybe(0.3):
            body -= along_y(hole(0.3 * r, 2 * r)).translate((0, r, draw(0.8, 0.9) * length))
        return body
    bend, angle = r * draw(2.5, 5), draw(30, 100) + (80 if kind == "hooked" else 0)
    turns = [angle, -angle] if kind == "crank" else [angle]
    reach = draw(0.15, 0.5) * length
    # In the plane, heading by heading: straight, turn, straight.
    headings = [0.0] * int(length / 2)
    for turn in turns:
        steps = max(6, int(abs(turn) / 5))
        headings += list(headings[-1] + np.radians(turn) * (np.arange(steps) + 0.5) / steps)
        headings += [headings[-1] + np.radians(turn) * 0.5 / steps] * int(reach / 2)
    lengths = [2.0 if a == b else bend * abs(b - a) for a, b in zip([0.0, *headings], headings, strict=False)]
    moves = np.stack([np.cos(headings), np.sin(headings)], axis=1) * np.asarray(lengths)[:, None]
    path = np.pad(np.cumsum(np.concatenate([[[0.0, 0.0]], moves]), axis=0), ((0, 0), (0, 1)))
    body = swept(path, r, segments=SMALL)
    if wall:
        ends = np.stack([path[0] * 2 - path[1], *path, path[-1] * 2 - path[-2]])
        body -= swept(ends, r - wall, segments=SMALL)
    return body


def profile(draw: Draw) -> Manifold:
    """A length of angle, channel, T, I, box or slotted extrusion, plain or drilled."""
    a, b, t, length = draw(14, 30), draw(14, 36), draw(1.5, 4), draw(25, 90)
    kind = draw.one_of(["angle", "channel", "t", "i", "box", "slotted"])
    if kind == "angle":
        outline = polygon([(0, 0), (a, 0), (a, t), (t, t), (t, b), (0, b)]).translate((-t / 2, -t / 2))
    elif kind == "channel":
        outline = rectangle(a, b) - CrossSection.square((a, b - 2 * t), True).translate((t, 0))
    elif kind == "t":
        outline = rectangle(a, t) + CrossSection.square((t, b)).translate((-t / 2, -b))
    elif kind == "i":
        flanges = rectangle(a, t).translate((0, b / 2)) + rectangle(a, t).translate((0, -b / 2))
        outline = rectangle(t, b) + flanges
    elif kind == "box":
        outline = rectangle(a, b, 2 * t) - rectangle(a - 2 * t, b - 2 * t, t)
    else:
        mouth = rectangle(0.6 * a, 0.28 * a).translate((0.5 * a, 0))
        pocket = polygon([(0.41 * a, -0.29 * a), (0.41 * a, 0.29 * a), (0.2 * a, 0.1 * a), (0.2 * a, -0.1 * a)])
        outline = rectangle(a, a, 0.08 * a) - CrossSection.circle(draw(0.07, 0.11) * a, SMALL)
        for i in range(4):
            outline -= (mouth.translate((0.22 * a, 0)) + pocket).rotate(90 * i)
    fillet = draw(0.12, 0.3) * t
    body = extrude(rounded(outline, fillet, 0 if kind == "slotted" else draw(0.3, 1.2) * t), length)
    count = draw.whole(0, 3)
    if kind != "slotted" and count:
        x = 0.0 if kind in ("channel", "box") else 0.32 * a
        drill = along_y(cylinder(draw(1.2, 2.4), 3 * b, SMALL)).translate((x, 1.5 * b, 0))
        body -= union(drill.translate((0, 0, length * (i + 0.5) / count)) for i in range(count))
    return body


def washer(draw: Draw) -> Manifold:
    """A washer or thick spacer: plain, bevelled, split as a spring, tabbed, toothed, or square."""
    bore, t = draw(4, 12), draw(0.8, 3)
    outer = bore * draw(1.25, 2.6)
    kind = draw.one_of(["plain", "bevelled", "spring", "tab", "toothed", "square", "spacer"])
    ring = CrossSection.circle(outer, 96)
    if kind == "bevelled":
        body = turned([(0, 0), (outer, 0), (outer, 0.4 * t), (0.6 * outer + 0.4 * bore, t), (0, t)], segments=96)
        return body - hole(bore, t).translate((0, 0, 0))
    if kind == "spring":
        t = 0.45 * (outer - bore)
        gap = extrude(rectangle(2 * outer, 0.5 * t), 3 * t).rotate((35, 0, 0)).translate((outer, t, -t))
        return extrude(ring, t) - cylinder(bore, 3 * t, ROUND).translate((0, 0, -t)) - gap
    if kind == "tab":
        for i in range(draw.whole(1, 2)):
            tab = rectangle(draw(1.2, 2) * outer, draw(0.35, 0.7) * outer, 0.15 * outer).translate((outer, 0))
            ring += tab.rotate(90.0 * i)
        ring = rounded(ring, 0.3, 0.8)
    elif kind == "toothed":
        notch = rectangle(0.5 * (outer - bore), draw(0.1, 0.16) * outer, 0.4).translate((outer, 0))
        for i in range(count := draw.whole(8, 14)):
            ring -= notch.rotate(360 * i / count)
    elif kind == "square":
        ring = rectangle(2 * outer, 2 * outer, draw(0.1, 0.4) * outer)
    elif kind == "spacer":
        return chamfered(ring, draw(0.4, 2.4) * outer, 0.5) - hole(bore, 3 * outer)
    hollow = rectangle(1.6 * bore, 1.6 * bore, 0.2) if draw.maybe(0.2) else CrossSection.circle(bore, ROUND)
    return extrude(ring - hollow, t)


def circlip(draw: Draw) -> Manifold:
    """A retaining ring: thicker opposite its gap, with eyes for pliers inside or outside; or an E-clip."""
    r, t = draw(7, 22), draw(0.8, 2)
    thick, gap = draw(0.16, 0.28) * r, draw(12, 35)
    ring = CrossSection.circle(r, 96)
    if draw.maybe(0.7):
        eye, out = draw(0.11, 0.17) * r, draw.one_of([1, -1])
        ring -= CrossSection.circle(r - thick, 96).translate((out * 0.3 * thick, 0))
        a = np.radians(gap / 2)
        x, y = float(r * np.cos(a)), float(r * np.sin(a))
        ring -= polygon([(0, 0), (2 * x, -2 * y), (2 * x, 2 * y)])
        place = 1 + out * (eye / r) - (0.8 * thick / r if out < 0 else 0.4 * thick / r)
        lobes = [(place * x, side * (place * y + 0.6 * eye)) for side in (-1, 1)]
        for lobe in lobes:
            ring += CrossSection.circle(eye, SMALL).translate(lobe)
        ring = rounded(ring, 0.06 * r * 0.5, 0.04 * r)
        for lobe in lobes:
            ring -= CrossSection.circle(0.45 * eye, SMALL).translate(lobe)
        return extrude(ring, t)
    inner = CrossSection.circle(0.62 * r, ROUND) + CrossSection.square((r, draw(0.7, 1.0) * r), True).translate(
        (r * 0.7, 0)
    )
    ring -= inner
    for angle in (0, 120, 240):
        prong = rectangle(0.4 * r, draw(0.2, 0.3) * r, 0.05 * r).translate((-0.58 * r, 0)).rotate(angle)
        ring += prong if angle == 0 else prong.rotate(draw(-12, 0))
    return extrude(rounded(ring.offset(-0.01 * r, JoinType.Miter), 0.02 * r, 0.05 * r), t)
