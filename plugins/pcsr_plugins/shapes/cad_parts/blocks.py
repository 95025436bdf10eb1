"""Milled and cast parts: housings, clamps, blocks with pockets, ribs and bores."""

from manifold3d import CrossSection, Manifold

from pcsr_plugins.shapes.cad_parts.solids import (
    SMALL,
    along_x,
    along_y,
    arc,
    box,
    chamfered,
    cylinder,
    extrude,
    grid_of,
    hole,
    rectangle,
    ring_of,
    rounded,
    tube,
    union,
)
from pcsr_plugins.shapes.shared.draw import Draw


def clamp(draw: Draw) -> Manifold:
    """A split shaft collar or pipe clamp: a ring with a slit and bolted ears."""
    bore, wall, t = draw(8, 22), draw(3, 8), draw(8, 22)
    outer, slit = bore + wall, draw(1.5, 4)
    ear_x, ear_y = draw(8, 16), slit + 2 * draw(3, 6)
    profile = CrossSection.circle(outer, 96)
    profile += rectangle(ear_x + wall, ear_y, 2).translate((outer + (ear_x - wall) / 2, 0))
    base = draw.maybe()
    if base:
        profile += rectangle(2 * outer + draw(10, 30), draw(5, 9), 2).translate((0, -outer))
    profile = rounded(profile, 0.5, 1.5) - CrossSection.circle(bore, 96)
    profile -= CrossSection.square((2 * outer + ear_x, slit), True).translate((outer + ear_x / 2, 0))
    body = extrude(profile, t)
    screw = along_y(hole(draw(1.5, 3), 4 * ear_y)).translate((outer + 0.55 * ear_x, 2 * ear_y, t / 2))
    body -= screw
    if base:
        foot = along_y(hole(draw(1.5, 2.2), 3 * outer)).translate((0, 0, t / 2))
        body -= union(foot.translate((x * (outer + 3.5), -outer / 2, 0)) for x in (-1, 1))
    return body


def housing(draw: Draw) -> Manifold:
    """An open electronics housing: thin walls, screw bosses, cut-outs and perhaps inner ribs."""
    a, b, h, wall = draw(50, 100), draw(35, 70), draw(15, 40), draw(1.8, 4)
    outline = rectangle(a, b, draw(3, 10))
    body = extrude(outline, h) - extrude(outline.offset(-wall), h).translate((0, 0, wall))
    boss = draw(2.5, 4.5)
    corners = [(x, y) for x in (-1, 1) for y in (-1, 1)]
    inset = wall + 0.8 * boss
    positions = [(x * (a / 2 - inset), y * (b / 2 - inset)) for x, y in corners]
    height = h * draw(0.5, 0.95)
    body += grid_of(cylinder(boss, height, SMALL), positions)
    body -= grid_of(cylinder(0.45 * boss, h, SMALL).translate((0, 0, wall)), positions)
    window = along_x(extrude(rectangle(draw(0.25, 0.5) * h, draw(0.2, 0.5) * b, 1.5), 3 * wall))
    body -= window.translate((a / 2 - 2 * wall, 0, 0.5 * h))
    if draw.maybe():
        vent = box(draw(1.5, 2.5), 0.45 * b, 3 * wall).translate((0, 0, -wall))
        count = draw.whole(3, 6)
        body -= grid_of(vent, [((i - (count - 1) / 2) * 6, 0) for i in range(count)])
    if draw.maybe():
        body += box(wall, b - wall, 0.6 * h).translate((draw(-0.2, 0.2) * a, 0, 0))
    if draw.maybe():
        lug = extrude(rectangle(draw(8, 14), 0.5 * b, 3), wall + 1)
        lug -= hole(2, wall + 1)
        body += union(lug.translate((x * (a / 2 + 3), 0, 0)) for x in (-1, 1))
    return body


def heat_sink(draw: Draw) -> Manifold:
    """A base with straight fins, or with pins."""
    a, b, base, h = draw(35, 80), draw(30, 70), draw(3, 8), draw(12, 35)
    body = chamfered(rectangle(a, b, draw(0.5, 3)), base, 0.4)
    if draw.maybe(0.65):
        count, t = draw.whole(5, 12), draw(1.2, 2.4)
        fin = box(t, b - 0.6, h).translate((0, 0, base - 0.5))
        body += grid_of(fin, [((i / (count - 1) - 0.5) * (a - t - 1), 0) for i in range(count)])
        if draw.maybe():
            body -= box(a + 2, draw(3, 6), h + 1).translate((0, draw(-0.2, 0.2) * b, base + 0.5))
    else:
        nx, ny, r = draw.whole(3, 7), draw.whole(3, 6), draw(1.3, 2.6)
        pin = cylinder(r, h, 24).translate((0, 0, base - 0.5))
        positions = [
            (-a / 2 + 2 * r + i * (a - 4 * r) / (nx - 1), -b / 2 + 2 * r + j * (b - 4 * r) / (ny - 1))
            for i in range(nx)
            for j in range(ny)
        ]
        body += grid_of(pin, positions)
    return body


def arch(draw: Draw) -> Manifold:
    """A bridge over a span: an arch between two piers, perhaps with a parapet or a keystone."""
    span, rise, depth, t = draw(25, 50), draw(10, 25), draw(10, 30), draw(4, 10)
    outer = [(x * (span + 2 * t) / (2 * rise), y) for x, y in arc(rise, 0, 180)]
    pier = draw(8, 30)
    wide = span / 2 + t
    profile = CrossSection([[(-wide, -pier), (wide, -pier), (wide, 0), *[(x, y + t) for x, y in outer], (-wide, 0)]])
    inner = [(x * span / (2 * rise), y) for x, y in arc(rise, 0, 180)]
    profile -= CrossSection([[(-span / 2, -pier - 1), (span / 2, -pier - 1), *inner]])
    body = along_y(extrude(rounded(profile, 0.5), depth)).translate((0, depth / 2, 0))
    if draw.maybe():
        deck = box(2 * wide + draw(2, 8), depth + draw(0, 4), draw(2, 5))
        body += deck.translate((0, 0, rise + t - 1))
        if draw.maybe():
            rail = box(2 * wide, draw(1.5, 3), draw(3, 7))
            body += union(rail.translate((0, y * (depth / 2 - 1.5), rise + t)) for y in (-1, 1))
    if draw.maybe():
        foot = box(t + draw(4, 9), depth + draw(2, 8), draw(2, 5))
        body += union(foot.translate((x * (span + t) / 2, 0, -pier)) for x in (-1, 1))
    return body


def pillow_block(draw: Draw) -> Manifold:
    """A bearing stand: a footed block with a bore, bolted down through slots."""
    bore, wall, t = draw(7, 16), draw(4, 9), draw(12, 26)
    outer, height = bore + wall, bore + wall + draw(4, 14)
    foot, base = outer + draw(9, 18), draw(4, 8)
    profile = CrossSection.circle(outer, 96).translate((0, height))
    profile += CrossSection.square((2 * outer, height), False).translate((-outer, 0))
    profile += CrossSection.square((2 * foot, base), False).translate((-foot, 0))
    body = along_y(extrude(rounded(profile, 0.6, draw(1, 4)), t)).translate((0, t / 2, 0))
    body -= along_y(hole(bore, t)).translate((0, t / 2, height))
    slot = extrude(rectangle(draw(6, 8), draw(3, 5), 1.5), base + 4).translate((0, 0, -1))
    body -= grid_of(slot, [(x * (foot + outer) / 2, 0) for x in (-1, 1)])
    if draw.maybe():
        body += cylinder(draw(2, 3), wall + 5, SMALL).translate((0, 0, height + outer - 3))
    if draw.maybe():
        groove = along_y(tube(bore + 1.2, bore - 1, 2)).translate((0, 1, height))
        body -= groove
    return body


def manifold_block(draw: Draw) -> Manifold:
    """A hydraulic block: crossing bores from several faces, counterbored ports, mounting holes."""
    a, b, h = draw(35, 75), draw(25, 45), draw(25, 45)
    body = chamfered(rectangle(a, b, draw(0.5, 3)), h, draw(0.5, 2))
    main = draw(3, 6)
    body -= along_x(hole(main, a + 10)).translate((-a / 2 - 5, 0, 0.5 * h))
    count = draw.whole(2, 4)
    for i in range(count):
        x = (i - (count - 1) / 2) * (a - 14) / max(1, count - 1)
        r = draw(2, 4.5)
        body -= hole(r, h).translate((x, 0, 0.5 * h))
        body -= cylinder(r + draw(0.8, 1.6), draw(2, 5) + 1).translate((x, 0, h - 3))
    if draw.maybe():
        body -= along_y(hole(draw(2, 4), b)).translate((draw(-0.2, 0.2) * a, b / 2, 0.5 * h))
    corners = [(x * (a / 2 - 4.5), y * (b / 2 - 4.5)) for x in (-1, 1) for y in (-1, 1)]
    return body - grid_of(hole(draw(1.3, 2.2), h), corners if draw.maybe() else corners[::3])


def machined_block(draw: Draw) -> Manifold:
    """A block with steps, pockets, slots and holes, as a milling exercise has them."""
    a, b, h = draw(40, 80), draw(30, 60), draw(15, 40)
    body = chamfered(rectangle(a, b, draw(0.5, 4)), h, draw(0.3, 1))
    for side in (-1, 1) if draw.maybe() else (1,):
        step = box(draw(0.15, 0.3) * a, b + 2, draw(0.3, 0.6) * h)
        body -= step.translate((side * a / 2, 0, h - draw(0.3, 0.55) * h))
    pocket = extrude(rectangle(draw(0.25, 0.4) * a, draw(0.35, 0.6) * b, draw(2, 5)), h)
    body -= pocket.translate((draw(-0.1, 0.1) * a, 0, draw(0.35, 0.7) * h))
    if draw.maybe():
        slot = box(a + 2, draw(0.1, 0.2) * b, draw(0.2, 0.4) * h)
        body -= slot.translate((0, draw(-0.3, 0.3) * b, 0.75 * h))
    if draw.maybe():
        body -= hole(draw(2, 5), h).translate((draw(-0.3, 0.3) * a, draw(-0.2, 0.2) * b, 0))
    if draw.maybe():
        body -= along_y(hole(draw(2, 4), b)).translate((draw(-0.25, 0.25) * a, b / 2, 0.22 * h))
    return body


def joint(draw: Draw) -> Manifold:
    """A clevis: a forked end with a cross bore on a shank or a flanged foot."""
    gap, ear, r = draw(6, 16), draw(4, 9), draw(7, 14)
    reach, back = draw(14, 28), draw(5, 10)
    wide = gap + 2 * ear
    ears = extrude(
        CrossSection.circle(r, 64).translate((reach, 0)) + CrossSection.square((reach, 2 * r)).translate((0, -r)),
        wide,
    )
    body = ears.translate((0, 0, -wide / 2)) - box(reach + r + 2, 2 * r + 2, gap).translate(
        (back + (reach + r) / 2, 0, -gap / 2)
    )
    body -= hole(0.45 * r, 2 * wide).translate((reach, 0, -wide))
    if draw.maybe(0.6):
        shank = draw(0.5, 0.9) * min(r, wide / 2)
        body += along_x(cylinder(shank, draw(18, 45))).rotate((0, 0, 180)).translate((1, 0, 0))
        if draw.maybe():
            body -= along_x(cylinder(0.5 * shank, 20, SMALL)).rotate((0, 0, 180)).translate((-10, 0, 0))
    else:
        foot = draw(1.6, 2.2) * r
        base = along_x(extrude(rectangle(wide + 8, 2 * foot, 4), 5)).translate((-4, 0, 0))
        bolts = ring_of(cylinder(1.8, 20, 24).translate((0, 0, -10)), 2, foot - 4, 90)
        body += base
        body -= along_x(bolts)
    return body


def lever(draw: Draw) -> Manifold:
    """A crank or lever: two bosses with bores joined by a tapering arm, webbed or solid."""
    length, r1, r2 = draw(35, 80), draw(8, 15), draw(5, 10)
    h1, h2, t = draw(10, 22), draw(8, 16), draw(4, 8)
    arm = CrossSection.batch_hull(
        [CrossSection.circle(0.8 * r1, 64), CrossSection.circle(0.8 * r2, 64).translate((length, 0))]
    )
    if draw.maybe():
        web = arm.offset(-draw(1.8, 2.8))
        body = extrude(arm, t) - extrude(web, t).translate((0, 0, 0.55 * t))
    else:
        body = extrude(arm, t)
    body += cylinder(r1, h1) + cylinder(r2, h2).translate((length, 0, 0))
    body -= hole(draw(0.45, 0.65) * r1, h1)
    body -= hole(draw(0.4, 0.6) * r2, h2).translate((length, 0, 0))
    if draw.maybe():
        key = box(0.3 * r1, r1, h1 + 2).translate((0, 0.5 * r1, -1))
        body -= key - cylinder(2 * r1, h1 + 4) + (key ^ cylinder(0.78 * r1, h1 + 2).translate((0, 0, -1)))
    if draw.maybe():
        angle = draw(70, 140)
        body += body.rotate((0, 0, angle)) - cylinder(0.7 * r1, h1 + 2).translate((0, 0, -1))
        body -= hole(0.45 * r1, h1)
    return body
