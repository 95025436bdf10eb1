"""Parts that turn and push: gears, sprockets, ratchets, cams, impellers."""

import numpy as np
from manifold3d import CrossSection, Manifold

from pcsr_plugins.shapes.cad_parts.solids import (
    SMALL,
    box,
    cylinder,
    extrude,
    hole,
    rectangle,
    ring_of,
    rounded,
    tube,
    turned,
    union,
)
from pcsr_plugins.shapes.shared.draw import Draw, Number


def _bored(body: Manifold, draw: Draw, bore: Number, height: Number) -> Manifold:
    """A bore with or without a keyway."""
    body -= cylinder(bore, 4 * height + 20, SMALL).translate((0, 0, -2 * height - 10))
    if draw.maybe():
        body -= box(bore, 0.6 * bore, 4 * height + 20).translate((0.8 * bore, 0, -2 * height - 10))
    return body


def gear(draw: Draw) -> Manifold:
    """A spur or helical gear with a hub, a recessed web or lightening holes."""
    teeth, module, t = draw.whole(12, 28), draw(1.6, 3), draw(6, 16)
    r = module * teeth / 2
    inner, outer = r - 1.25 * module, r + module
    angles = 2 * np.pi / teeth
    outline = []
    for i in range(teeth):
        a = i * angles
        for radius, share in (
            (inner, -0.36),
            (r, -0.25),
            (outer, -0.12),
            (outer, 0.12),
            (r, 0.25),
            (inner, 0.36),
        ):
            outline.append((float(radius * np.cos(a + share * angles)), float(radius * np.sin(a + share * angles))))
    profile = CrossSection([outline])
    helix = draw(8, 25) if draw.maybe(0.3) else 0.0
    body = Manifold.extrude(profile, t, 8 if helix else 0, helix)
    bore = draw(0.16, 0.3) * r
    hub = bore + draw(0.12, 0.2) * r
    if draw.maybe():
        web = tube(inner - 0.12 * r, hub, t)
        depth = draw(0.2, 0.33) * t
        body -= web.translate((0, 0, t - depth))
        body -= web.translate((0, 0, depth - t))
    if draw.maybe():
        body += cylinder(hub, t + draw(3, 10))
    if draw.maybe() and inner - hub > 7:
        size = min(0.3 * (inner - hub), 0.2 * r)
        body -= ring_of(hole(size, t), draw.whole(4, 6), (inner + hub) / 2)
    return _bored(body, draw, bore, t)


def sprocket(draw: Draw) -> Manifold:
    """A chain sprocket: rounded gaps between pointed teeth, a hub, often lightened."""
    teeth, roller, t = draw.whole(9, 22), draw(2.4, 4), draw(2.5, 5)
    r = 2.6 * roller * teeth / (2 * np.pi) * draw(1.0, 1.15)
    profile = CrossSection.circle(r + 0.9 * roller, 128)
    for i in range(teeth):
        a = 2 * np.pi * i / teeth
        profile -= CrossSection.circle(roller, 24).translate((float(r * np.cos(a)), float(r * np.sin(a))))
    body = extrude(rounded(profile, 0.25), t)
    bore = draw(0.15, 0.28) * r
    body += cylinder(bore + draw(3, 6), t + draw(4, 12))
    if draw.maybe():
        body -= ring_of(hole(0.16 * r, t), draw.whole(3, 6), 0.62 * r)
    return _bored(body, draw, bore, t)


def ratchet(draw: Draw) -> Manifold:
    """A ratchet wheel with saw teeth and a square or round hole."""
    teeth, r, t = draw.whole(8, 20), draw(15, 30), draw(4, 10)
    tip = r * draw(1.12, 1.28)
    outline = []
    for i in range(teeth):
        for radius, share in ((r, 0.0), (tip, 0.82), (tip, 0.9)):
            a = 2 * np.pi * (i + share) / teeth
            outline.append((float(radius * np.cos(a)), float(radius * np.sin(a))))
    body = extrude(rounded(CrossSection([outline]), 0.01 * r, 0.03 * r), t)
    bore = draw(0.2, 0.38) * r
    if draw.maybe():
        body += cylinder(bore * 1.6, t + draw(2, 9))
    if draw.maybe():
        return body - extrude(rectangle(1.5 * bore, 1.5 * bore, 0.1 * bore), 99).translate((0, 0, -40))
    return _bored(body, draw, bore, t)


def cam(draw: Draw) -> Manifold:
    """A disc cam: an eccentric or a lobe, on a hub, with a slot or a follower pin."""
    r, t, lift = draw(10, 20), draw(4, 10), draw(5, 14)
    nose = draw(0.25, 0.6) * r
    profile = CrossSection.batch_hull(
        [CrossSection.circle(r, 96), CrossSection.circle(nose, 64).translate((r + lift - nose, 0))]
    )
    if draw.maybe(0.4):
        profile = rounded(profile + profile.rotate(draw(90, 180)), 0.0, 2)
    body = extrude(profile, t)
    bore = draw(0.25, 0.4) * r
    hub = bore + draw(2, 4)
    body += cylinder(hub, t + draw(3, 12))
    if draw.maybe():
        body += cylinder(0.4 * nose, t + draw(5, 12), SMALL).translate((r + lift - 1.2 * nose, 0, 0))
    if draw.maybe(0.4):
        body += extrude(profile.scale((0.7, 0.7)), t).translate((0, 0, -t + 0.5))
    return _bored(body, draw, bore, t)


def impeller(draw: Draw) -> Manifold:
    """Curved blades on a disc with a hub; on some a shroud ring or a cone."""
    r, base, h, blades = draw(20, 38), draw(2, 4), draw(8, 18), draw.whole(5, 10)
    t, sweep, hub = draw(1.3, 2.4), draw(20, 70), draw(5, 9)
    start = hub * 0.8
    steps = np.linspace(0, 1, 16)
    radius = start + (0.98 * r - start) * steps
    angle = np.radians(sweep) * steps**1.4
    line = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    direction = np.gradient(line, axis=0)
    side = (
        np.stack([-direction[:, 1], direction[:, 0]], axis=1) / np.linalg.norm(direction, axis=1, keepdims=True) * t / 2
    )
    outline = [*map(tuple, (line + side).tolist()), *map(tuple, (line - side)[::-1].tolist())]
    blade = CrossSection([outline])
    if blade.area() <= 0:
        blade = CrossSection([outline[::-1]])
    solid = extrude(blade, base + h)
    if draw.maybe():  # blades that fall off towards the rim
        low = draw(0.4, 0.75)
        solid ^= turned([(0, 0), (r + 1, 0), (r + 1, base + low * h), (hub, base + h), (0, base + h)])
    body = cylinder(r, base, 96) + union(solid.rotate((0, 0, 360 * i / blades)) for i in range(blades))
    body += turned([(0, 0), (hub + draw(0, 4), 0), (hub, base + h + 0.4), (0, base + h + 0.4)])
    if draw.maybe(0.4):
        rim = CrossSection.circle(r, 96) - CrossSection.circle(r - draw(1.5, 2.5), 96)
        body += extrude(rim, base + 0.9 * h)
    return _bored(body, draw, 0.5 * hub, h)
