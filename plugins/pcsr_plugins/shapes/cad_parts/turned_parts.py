"""Parts from the lathe."""

import numpy as np
from manifold3d import CrossSection, Manifold

from pcsr_plugins.shapes.cad_parts.solids import (
    SMALL,
    along_x,
    box,
    cylinder,
    extrude,
    hole,
    rectangle,
    ring_of,
    swept,
    tube,
    turned,
    union,
)
from pcsr_plugins.shapes.shared.draw import Draw


def knob(draw: Draw) -> Manifold:
    """A grip knob: fluted or lobed, domed or flat, on a neck with a bore."""
    r, h, neck = draw(12, 25), draw(10, 22), draw(5, 9)
    body = turned([(0, 0), (r, 0), (draw(0.75, 1) * r, h), (0, h)], draw(1, 3))
    flutes = draw.whole(5, 14)
    if draw.maybe(0.7):
        size = draw(0.1, 0.22) * r
        body -= ring_of(cylinder(size, h + 2, SMALL).translate((0, 0, -1)), flutes, r * 1.02 + 0.3 * size)
    else:
        lobe = draw(0.25, 0.35) * r
        body += ring_of(cylinder(lobe, 0.8 * h), draw.whole(3, 6), r)
    body += cylinder(neck, draw(6, 14), SMALL).rotate((180, 0, 0)).translate((0, 0, 1))
    body -= cylinder(0.5 * neck, 0.5 * h + 20, SMALL).translate((0, 0, -20))
    if draw.maybe():
        body -= turned([(0, h - draw(1, 3)), (0.6 * r, h - draw(1, 3)), (0.65 * r, h + 1), (0, h + 1)])
    return body


def bearing(draw: Draw) -> Manifold:
    """A ball bearing: its cage bridging the balls, or shielded; flanged or grooved for a snap ring on some."""
    bore, t = draw(7, 16), draw(7, 15)
    race, ball = bore + draw(2.5, 4), draw(0.24, 0.36) * t
    middle = race + ball * 0.9
    inside = middle + 0.9 * ball
    outer = inside + draw(2.5, 4.5)
    c = draw(0.3, 0.8)
    edge = [(outer - c, 0), (outer, c), (outer, t - c), (outer - c, t)]
    outer_ring = turned([(inside, 0), *edge, (inside, t)])
    inner_ring = turned([(bore, c), (bore + c, 0), (race, 0), (race, t), (bore + c, t), (bore, t - c)])
    collar = draw.one_of(["none", "flange", "groove"])
    if collar == "flange":
        outer_ring += tube(outer + draw(1.5, 3), inside + 0.5, draw(1, 2.4))
    elif collar == "groove":
        outer_ring -= tube(outer + 1, outer - draw(0.6, 1.2), draw(1, 1.8)).translate((0, 0, 0.7 * t))
    if draw.maybe(0.6):
        balls = ring_of(Manifold.sphere(ball, SMALL), draw.whole(7, 12), middle).translate((0, 0, t / 2))
        cage = tube(middle + 0.5 * ball, middle - 0.5 * ball, 0.6 * ball).translate((0, 0, t / 2 - 0.3 * ball))
        web = ring_of(box(2 * ball + 2.4, 1.2, 0.5 * t).translate((0, 0, 0.25 * t)), 3, middle)
        return inner_ring + outer_ring + balls + cage + web
    shield = tube(middle + ball, race - 0.1, 0.86 * t).translate((0, 0, 0.07 * t))
    return inner_ring + outer_ring + shield


def pulley(draw: Draw) -> Manifold:
    """A belt pulley: one or two grooves, a hub, and a web with spokes or holes."""
    r, width, bore = draw(20, 38), draw(9, 18), draw(3, 6)
    depth, hub = draw(2.5, 5), bore + draw(3, 6)
    grooves = draw.whole(1, 2)
    profile: list[tuple[float, float]] = [(r, 0.0)]
    pitch = width / grooves
    for i in range(grooves):
        z = i * pitch
        profile += [
            (r, z + 0.15 * pitch),
            (r - depth, z + 0.38 * pitch),
            (r - depth, z + 0.62 * pitch),
            (r, z + 0.85 * pitch),
        ]
    profile += [(r, width), (r - depth - 3, width), (r - depth - 3, 0)]
    rim = turned(profile)
    body = rim + cylinder(hub, width + draw(0, 8))
    web = draw(2.5, 5)
    inner = r - depth - 2.5
    if draw.maybe():
        disc = cylinder(inner, web) - ring_of(
            cylinder(0.3 * (inner - hub), 30, SMALL).translate((0, 0, -5)),
            draw.whole(4, 7),
            (inner + hub) / 2,
        )
    else:
        disc = ring_of(box(inner - 0.5 * hub, draw(3, 6), web), draw.whole(3, 6), (inner + 0.5 * hub) / 2)
    body += disc.translate((0, 0, (width - web) / 2))
    return body - cylinder(bore, 100, SMALL).translate((0, 0, -50))


def shaft(draw: Draw) -> Manifold:
    """A stepped shaft with chamfered ends, a groove, a keyway or a flat, perhaps a centre bore."""
    steps = draw.whole(3, 5)
    profile: list[tuple[float, float]] = [(0, 0)]
    z = 0.0
    radii = []
    for i in range(steps):
        r, length = draw(4, 12), draw(8, 24)
        radii.append((r, z, length))
        c = 0.8 if i in (0, steps - 1) else 0.0
        profile += [(r - (c if i == 0 else 0), z), (r, z + (c if i == 0 else 0))]
        z += length
        profile += [(r, z - (c if i == steps - 1 else 0)), (r - (c if i == steps - 1 else 0), z)]
    profile.append((0, z))
    body = turned(profile)
    r, z0, length = draw.one_of(radii)
    if draw.maybe(0.6):
        key = extrude(rectangle(0.6 * length, 0.45 * r, 0.22 * r), r).rotate((0, -90, 0)).rotate((0, 0, 180))
        body -= key.translate((0.7 * r, 0, z0 + 0.5 * length))
    else:
        body -= box(r, 3 * r, 0.8 * length).translate((1.25 * r, 0, z0 + 0.1 * length))
    r, z0, length = radii[-1]
    if draw.maybe():
        body -= tube(r + 1, 0.8 * r, 1.6).translate((0, 0, z0 + 0.6 * length))
    if draw.maybe():
        body -= cylinder(0.45 * min(radii[0][0], radii[-1][0]), z + 2, SMALL).translate((0, 0, -1))
    return body


def bushing(draw: Draw) -> Manifold:
    """A flanged bushing or spacer, with oil grooves, a slit or cross holes."""
    bore, wall, h = draw(5, 14), draw(2, 5), draw(14, 38)
    outer = bore + wall
    body = turned([(bore, 0), (outer, 0), (outer, h - 0.8), (outer - 0.8, h), (bore + 0.5, h), (bore, h - 0.5)])
    if draw.maybe(0.6):
        body += tube(outer + draw(3, 8), bore, draw(2, 4.5))
    kind = draw.whole(0, 2)
    if kind == 0:
        body -= box(outer + 12, draw(1, 2.5), h + 2).translate(((outer + 12) / 2, 0, -1))
    elif kind == 1:
        cross = along_x(cylinder(draw(1.2, 2.6), 4 * outer, SMALL)).translate((-2 * outer, 0, 0))
        levels = draw.whole(1, 2)
        body -= union(cross.rotate((0, 0, 90 * i)).translate((0, 0, h * (0.4 + 0.3 * i))) for i in range(levels))
    else:
        body -= union(tube(outer + 1, outer - 0.45 * wall, 2).translate((0, 0, h * f)) for f in (0.4, 0.6, 0.8))
    return body


def handwheel(draw: Draw) -> Manifold:
    """A rim on spokes with a hub, perhaps with a crank handle."""
    r, rim, hub = draw(25, 42), draw(2.5, 4.5), draw(6, 10)
    ring = Manifold.revolve(CrossSection.circle(rim, 24).translate((r, 0)), 72)
    spokes = draw.whole(3, 6)
    spoke = along_x(cylinder(draw(1.6, 0.7 * rim), r, 24))
    body = ring + union(spoke.rotate((0, 0, 360 * i / spokes)) for i in range(spokes))
    drop = draw(4, 9)
    body += cylinder(hub, 2 * drop).translate((0, 0, -drop))
    body -= cylinder(draw(0.4, 0.6) * hub, 60, SMALL).translate((0, 0, -30))
    if draw.maybe():
        grip = draw(2.5, 4)
        body += cylinder(0.7 * grip, 8, SMALL).translate((r, 0, 0)) + turned(
            [(0, 7), (grip, 7), (1.2 * grip, 14), (grip, 24), (0, 24)], 1
        ).translate((r, 0, 0))
    return body


def lamp_post(draw: Draw) -> Manifold:
    """A street lamp: a stepped foot, a tapering post, one or two curved arms with lanterns."""
    h, r = draw(60, 110), draw(1.8, 3.2)
    foot = draw(6, 10)
    body = turned([(0, 0), (foot, 0), (foot, 3), (0.7 * foot, 5), (0.55 * foot, 12), (r, 16), (0.7 * r, h), (0, h)])
    if draw.maybe():
        body += union(tube(1.7 * r, 0.3 * r, 2).translate((0, 0, h * f)) for f in (0.4, 0.75))
    arms, reach = draw.whole(0, 2), draw(10, 22)
    lantern = turned([(0, 0), (draw(3, 5), 0), (draw(4, 6.5), 8), (2, 11), (0, 12)])
    if arms == 0:
        return body + lantern.translate((0, 0, h - 1))
    t = np.linspace(0, np.pi, 25)
    path = np.stack([(1 - np.cos(t)) * reach / 2, 0 * t, h - 4 + np.sin(t) * reach * 0.45], axis=1)
    arm = swept(path, 0.6 * r) + lantern.rotate((180, 0, 0)).translate((reach, 0, h - 2.5))
    for i in range(arms):
        body += arm.rotate((0, 0, 180 * i))
    return body + cylinder(0.9 * r, 6).translate((0, 0, h - 6))


def nozzle(draw: Draw) -> Manifold:
    """A conical nozzle with a hexagonal grip and a stepped bore."""
    r, tip, h1, h2 = draw(6, 12), draw(1.5, 3.5), draw(8, 18), draw(10, 25)
    body = turned([(0, 0), (r, 0), (r, h1), (tip + 1.2, h1 + h2), (0, h1 + h2)], 0.3)
    grip = draw(4, 8)
    body += cylinder(1.35 * r, grip, 6).translate((0, 0, h1 - grip))
    body -= turned(
        [
            (0, -1),
            (0.7 * r, -1),
            (0.7 * r, h1),
            (0.6 * tip, h1 + 0.7 * h2),
            (0.6 * tip, h1 + h2 + 1),
            (0, h1 + h2 + 1),
        ]
    )
    if draw.maybe():
        body -= union(tube(r + 1, 0.88 * r, 1.2).translate((0, 0, 1.2 + 2.4 * i)) for i in range(2))
    if draw.maybe():
        body += tube(r + draw(3, 6), 0.7 * r, 2.5)
    return body - ring_of(hole(0.9, h1), 3, 0.85 * r) if draw.maybe(0.3) else body
