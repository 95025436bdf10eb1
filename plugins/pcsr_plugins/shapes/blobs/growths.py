"""What grows joint by joint: chains of lumps, branches, arms around a middle."""

import numpy as np

from pcsr_plugins.shapes.blobs.sdf import (
    Field,
    above,
    bent,
    common,
    dented,
    ellipsoid,
    joined,
    limb,
    moved,
    rippled,
)
from pcsr_plugins.shapes.shared.draw import Draw


def caterpillar(draw: Draw) -> Field:
    """Lumps in a winding row, with feet, feelers or neither."""
    lumps, gap = draw.whole(4, 9), draw(10, 15)
    sway, turns, lift = draw(0, 16), draw(0.5, 1.6), draw(0, 12)
    along = np.arange(lumps) - (lumps - 1) / 2
    phase = 2 * np.pi * turns * along / lumps
    middle = np.stack([gap * along, sway * np.sin(phase), lift * np.cos(phase)], axis=1)
    girth = [draw(9, 14) for _ in range(lumps)]
    body = [
        ellipsoid(tuple(at), (r * draw(0.8, 1), r, r * draw(0.85, 1.1))) for at, r in zip(middle, girth, strict=True)
    ]
    whole = joined(draw(2, 6), *body)
    if draw.maybe():
        foot, stance = draw(2.8, 4.5), draw(0.5, 0.8)
        feet = [
            limb([(x, y, z), (x, y + s * r * stance, z - r - draw(2, 7))], [5, foot])
            for (x, y, z), r in zip(middle, girth, strict=True)
            for s in (-1, 1)
        ]
        whole = joined(2, whole, *feet)
    if draw.maybe(0.6):
        (x, y, z), r = middle[-1], girth[-1]
        reach = draw(8, 18)
        whole = joined(
            2, whole, *(limb([(x, y, z), (x + 5, y + s * 7, z + r + reach)], [3.5, draw(2, 3.5)]) for s in (-1, 1))
        )
    return rippled(whole, draw, draw(0.1, 0.6), draw(12, 36))


def coral(draw: Draw) -> Field:
    """A stem that forks and forks again; also a cactus, an antler, a ginger root."""
    thick, shrink, spread = draw(7, 11), draw(0.72, 0.88), draw(24, 48)
    parts, tips = [], [((0.0, 0.0, -45.0), (0.0, 0.0, 1.0), thick, draw(24, 36))]
    for _ in range(draw.whole(2, 3)):
        grown = []
        for start, direction, r, length in tips:
            end = np.asarray(start) + length * np.asarray(direction)
            side = [draw(-4, 4) for _ in range(3)]
            parts.append(
                limb(
                    [start, tuple(0.5 * (np.asarray(start) + end) + side), tuple(end)],
                    [r, r * draw(0.8, 1.1), r * shrink],
                )
            )
            first = draw(0, 360)
            forks = draw.whole(2, 3)
            for fork in range(forks):
                angle, tilt = np.radians(first + 360 * fork / forks), np.radians(spread * draw(0.6, 1.2))
                level = np.array([np.cos(angle), np.sin(angle), 0]) * np.sin(tilt)
                new = 0.6 * np.asarray(direction) + level + np.array([0, 0, 0.5 * np.cos(tilt)])
                grown.append(
                    (tuple(end), tuple(new / np.linalg.norm(new)), max(r * shrink, 3.5), length * draw(0.7, 0.85))
                )
        tips = grown
    whole = joined(draw(3, 7), *parts, ellipsoid((0, 0, -46), (draw(10, 20), draw(10, 20), draw(4, 7))))
    return rippled(moved(whole, (0, 0, 10)), draw, draw(0.2, 0.8), draw(9, 24))


def mushroom(draw: Draw) -> Field:
    """A cap, hollow below, on a stem; or two of them."""

    def one(scale: float) -> Field:
        tall, wide, high = scale * draw(34, 60), scale * draw(22, 42), scale * draw(12, 26)
        lean = draw(-8, 8)
        stem = limb(
            [(0, 0, 0), (draw(-4, 4), 0, 0.5 * tall), (lean, 0, tall)],
            [scale * draw(7, 14), scale * draw(5, 9), scale * draw(6, 9)],
        )
        cap = dented(
            scale * draw(4, 7),
            ellipsoid((lean, 0, tall), (wide, wide * draw(0.9, 1.1), high)),
            ellipsoid((lean, 0, tall - high * draw(0.7, 1)), (0.85 * wide, 0.85 * wide, high * 0.75)),
        )
        return joined(draw(3, 8), stem, cap)

    whole = one(1.0)
    if draw.maybe(0.4):
        angle, far = np.radians(draw(0, 360)), draw(18, 30)
        whole = joined(5, whole, moved(one(draw(0.5, 0.7)), (far * np.cos(angle), far * np.sin(angle), 0)))
        whole = joined(6, whole, ellipsoid((0.4 * far * np.cos(angle), 0.4 * far * np.sin(angle), 0), (24, 24, 6)))
    return rippled(moved(common(3, whole, above(-2)), (0, 0, -35)), draw, draw(0.2, 0.9), draw(14, 40))


def starfish(draw: Draw) -> Field:
    """Arms around a middle, flat or curled up; a star, a flower, a squid."""
    arms, reach, core, thick, tip = draw.whole(3, 8), draw(26, 50), draw(9, 17), draw(5, 9), draw(2.4, 5)
    curl, swirl = draw(-16, 30), draw(-0.7, 0.7)
    parts = []
    for i in range(arms):
        turn, far = 2 * np.pi * i / arms + draw(-0.15, 0.15), reach * draw(0.8, 1.15)
        points = [
            (share * far * np.cos(turn + share * swirl), share * far * np.sin(turn + share * swirl), curl * share**2)
            for share in (0.1, 0.55, 1)
        ]
        parts.append(limb(points, [thick * 1.3, thick, tip]))
    whole = joined(draw(4, 8), ellipsoid((0, 0, 0), (core, core, core * draw(0.6, 1.5))), *parts)
    if draw.maybe(0.4):
        whole = bent(whole, draw(-12, 12), 50, along=0, towards=2)
    return rippled(whole, draw, draw(0.2, 0.8), draw(8, 26))
