"""What holds other parts: bolts, nuts, springs, hooks, links, clips."""

import numpy as np
from manifold3d import CrossSection, Manifold

from pcsr_plugins.shapes.cad_parts.solids import (
    SMALL,
    along_x,
    along_y,
    box,
    chamfered,
    cylinder,
    extrude,
    hole,
    ring_of,
    rounded,
    swept,
    tube,
    turned,
    union,
)
from pcsr_plugins.shapes.shared.draw import Draw


def bolt(draw: Draw) -> Manifold:
    """A screw: hexagon, socket, slotted or countersunk head, rings for a thread on the end of its shank."""
    r, length, head = draw(3, 6), draw(20, 55), draw(1.55, 1.9)
    k = draw(0.9, 1.5) * r
    kind = draw.whole(0, 3)
    if kind == 0:
        top = cylinder(head * r * 1.1, k, 6) ^ turned(
            [(0, 0), (head * r * 1.1, 0), (head * r * 1.1, 0.8 * k), (0.9 * head * r, k), (0, k)]
        )
    elif kind == 1:
        top = turned([(0, 0), (head * r, 0), (head * r, 1.5 * k), (0, 1.5 * k)], 0.5)
        top -= cylinder(0.9 * r, 2 * k, 6).translate((0, 0, 0.7 * k))
    elif kind == 2:
        top = turned([(0, 0), (head * r, 0), (head * r, 0.5 * k), (0.6 * head * r, k), (0, k)])
        top -= box(3 * head * r, 0.35 * r, k).translate((0, 0, 0.6 * k))
    else:
        top = cylinder(r, k, 64, top=head * r)
        slot = box(1.1 * head * r, 0.4 * r, k).translate((0, 0, 0.55 * k))
        top -= slot + slot.rotate((0, 0, 90))
    thread, pitch = draw(0.4, 0.9) * length, draw(1.1, 2)
    profile = [(0.0, 0.0), (r, 0.0), (r, -(length - thread))]
    z = length - thread
    while z + pitch < length - 1:
        profile += [(0.84 * r, -(z + 0.45 * pitch)), (r, -(z + 0.9 * pitch))]
        z += pitch
    profile += [(0.7 * r, -length), (0.0, -length)]
    body = top + turned(profile[::-1], segments=40).translate((0, 0, 0.01))
    if draw.maybe(0.3):
        body += tube(1.3 * head * r, 0.8 * r, draw(0.8, 1.6)).translate((0, 0, -1))
    return body


def nut(draw: Draw) -> Manifold:
    """A hexagon, flanged, castle or wing nut with rings for a thread."""
    r, h = draw(4, 9), 0.0
    h = draw(0.9, 1.6) * r
    wide = draw(1.75, 2.1) * r
    body = cylinder(wide, h, 6) ^ turned(
        [(0, 0), (0.9 * wide, 0), (wide, 0.12 * h), (wide, 0.88 * h), (0.9 * wide, h), (0, h)]
    )
    kind = draw.whole(0, 3)
    if kind == 1:
        body += turned([(0, 0), (1.35 * wide, 0), (1.35 * wide, 0.12 * h), (0.9 * wide, 0.4 * h), (0, 0.4 * h)])
    elif kind == 2:
        crown = tube(0.85 * wide, 0.9 * r, 1.5 * h)
        slot = box(3 * wide, 0.4 * r, h).translate((0, 0, h))
        body += crown - union(slot.rotate((0, 0, 60 * i)) for i in range(3))
    elif kind == 3:
        body = turned([(0, 0), (1.5 * r, 0), (1.3 * r, 1.3 * h), (0, 1.3 * h)])
        wing = CrossSection.batch_hull(
            [
                CrossSection.circle(0.4 * h, SMALL),
                CrossSection.circle(0.62 * h, SMALL).translate((1.5 * r, h)),
            ]
        )
        wings = along_y(extrude(wing, draw(1.5, 3)).translate((1.1 * r, 0.6 * h, -1)))
        body += wings + wings.rotate((0, 0, 180))
    bore = [(0.0, -1.0), (r, -1.0)]
    z, pitch = 0.0, draw(1.0, 1.8)
    while z < 1.6 * h:
        bore += [(r, z + 0.1 * pitch), (0.87 * r, z + 0.5 * pitch), (r, z + 0.9 * pitch)]
        z += pitch
    bore += [(r, z + 2), (0.0, z + 2)]
    return body - turned(bore, segments=48)


def spring(draw: Draw) -> Manifold:
    """A helical spring: straight, conical or barrel-shaped, with closed ends or hooks."""
    r, wire, turns = draw(8, 16), draw(1.1, 2.4), draw(3.5, 7.5)
    pitch = wire * draw(2.6, 4.5)
    t = np.linspace(0, 1, int(36 * turns))
    taper = draw.one_of(["none", "cone", "barrel"])
    shape = {
        "none": 1 + 0 * t,
        "cone": 1 - draw(0.2, 0.5) * t,
        "barrel": 1 - draw(0.2, 0.4) * (2 * t - 1) ** 2,
    }[taper]
    angle = 2 * np.pi * turns * t
    rise = np.clip((t * turns - 0.75), 0, turns - 1.5)
    z = rise * pitch + wire * 2.15 * (np.minimum(t * turns, 0.75) + np.maximum(t * turns - (turns - 0.75), 0))
    path = np.stack([r * shape * np.cos(angle), r * shape * np.sin(angle), z], axis=1)
    body = swept(path, wire, segments=14)
    if draw.maybe(0.4):
        end = path[-1]
        s = np.linspace(0, 1, 14)
        inward = np.stack([end[0] * (1 - s), end[1] * (1 - s), end[2] + pitch * s**2], axis=1)
        body += swept(inward, wire * 0.98, segments=14) + Manifold.sphere(wire, 20).translate(tuple(end))
        rod = inward[-1]
        body += cylinder(wire, draw(4, 12), 20).translate((float(rod[0]), float(rod[1]), float(rod[2]) - 0.3 * wire))
    return body


def hook(draw: Draw) -> Manifold:
    """A lifting hook: a bent, round body on a threaded or eyed shank."""
    r, wire, opening = draw(9, 18), draw(2.2, 4.2), draw(225, 275)
    t = np.radians(np.linspace(90, 90 - opening, 40))
    bend = np.stack([r * np.cos(t), 0 * t, r * np.sin(t)], axis=1)
    shank = draw(8, 22)
    up = np.stack([np.zeros(8), np.zeros(8), np.linspace(r + shank, r + 0.8, 8)], axis=1)
    body = swept(np.concatenate([up, bend]), wire, segments=24)
    body += Manifold.sphere(wire, 24).translate(tuple(map(float, bend[-1])))
    top = r + shank
    if draw.maybe():
        eye = draw(1.8, 2.8) * wire
        ring = Manifold.revolve(CrossSection.circle(0.9 * wire, 20).translate((eye, 0)), 48)
        body += along_x(ring).translate((0, 0, top + eye - 0.2 * wire))
    else:
        body += turned(
            [(0, 0), (1.7 * wire, 0), (1.7 * wire, wire), (wire, wire), (wire, 3 * wire), (0, 3 * wire)], 0.2
        ).translate((0, 0, top - 0.2))
    return body


def chain_link(draw: Draw) -> Manifold:
    """A link: an oval of wire, with a stud on some, or a flat roller-chain link with its pins."""
    r, straight = draw(6, 11), draw(8, 26)
    if draw.maybe(0.55):
        wire = draw(1.8, 3.6)
        t = np.radians(np.linspace(-90, 90, 28))
        right = np.stack([straight / 2 + r * np.cos(t), r * np.sin(t), 0 * t], axis=1)
        path = np.concatenate([right, right * [-1, -1, 1]])
        body = swept(path, wire, closed=True, segments=20)
        if draw.maybe():
            stud = along_y(cylinder(0.7 * wire, 2 * r, 24)).translate((0, r, 0))
            body += stud
        return body
    thick, gap = draw(1.5, 3), draw(4, 9)
    neck = CrossSection.batch_hull([CrossSection.circle(r, 64).translate((x * straight / 2, 0)) for x in (-1, 1)])
    waist = draw(1.2, 2.5) * r
    for y in (-1, 1):
        neck -= CrossSection.circle(waist, 96).translate((0, y * (waist + draw(0.5, 0.75) * r)))
    plates = extrude(neck, thick) + extrude(neck, thick).translate((0, 0, thick + gap))
    body = plates
    for x in (-1, 1):
        body += (
            cylinder(0.42 * r, 2 * thick + gap + 2) + tube(0.62 * r, 0.3 * r, gap).translate((0, 0, thick + 1))
        ).translate((x * straight / 2, 0, -1))
    return body


def clip(draw: Draw) -> Manifold:
    """A snap clip: a springy C with lips on a screwed foot."""
    r, wall, t, gap = draw(7, 16), draw(1.8, 3.5), draw(8, 22), draw(60, 110)
    outline = CrossSection.circle(r + wall, 96) - CrossSection.circle(r, 96)
    a = np.radians(gap / 2)
    wedge = CrossSection(
        [
            [
                (0.0, 0.0),
                (float(3 * r * np.cos(a)), float(-3 * r * np.sin(a))),
                (float(3 * r * np.cos(a)), float(3 * r * np.sin(a))),
            ]
        ]
    )
    outline -= wedge
    for side in (-1, 1):
        x, y = float((r + wall / 2) * np.cos(a)), float(side * (r + wall / 2) * np.sin(a))
        outline += CrossSection.circle(0.75 * wall, SMALL).translate((x + 0.2 * wall, y))
    foot, base = draw(1.1, 1.9) * r, draw(2.5, 5)
    outline += CrossSection.square((base, 2 * foot), False).translate((-r - wall - base + 1, -foot))
    body = extrude(rounded(outline, 0.3, 1), t)
    screw = along_x(hole(draw(1.2, 2), base + 4)).translate((-r - wall - base - 1, 0, t / 2))
    place = (foot + 0.4 * r) / 2 if foot > 1.4 * r else 0.0
    return body - union(screw.translate((0, y, 0)) for y in ((-place, place) if place else (0.0,)))


def stand_off(draw: Draw) -> Manifold:
    """A threaded stand-off on a hexagonal or knurled body with a stud."""
    r, h, stud = draw(4, 8), draw(12, 34), draw(5, 14)
    body = chamfered(CrossSection.circle(r, 6), h, 0.5) if draw.maybe() else cylinder(r, h)
    if draw.maybe(0.4):
        body -= ring_of(cylinder(0.5, h + 2, 8).translate((0, 0, -1)), 18, r + 0.1)
    body += turned([(0, -stud), (0.45 * r, -stud), (0.55 * r, -stud + 1), (0.55 * r, 0.1), (0, 0.1)])
    body -= cylinder(0.5 * r, draw(0.3, 0.7) * h + 1, SMALL).translate((0, 0, 0.5 * h))
    if draw.maybe():
        body += tube(1.6 * r, 0.4 * r, draw(1, 2.5))
    if draw.maybe():
        body -= along_x(cylinder(0.25 * r, 4 * r, SMALL)).translate((-2 * r, 0, 0.35 * h))
    return body
