"""People, or parts of them, as statuettes: upright, facing along +x."""

import numpy as np

from pcsr_plugins.shapes.blobs.sdf import Field, above, common, ellipsoid, joined, limb, moved, rippled, twisted
from pcsr_plugins.shapes.shared.draw import Draw

LEFT_AND_RIGHT = (-1, 1)


def figurine(draw: Draw) -> Field:
    """A person that stands or strides, arms anywhere, with legs or in a gown."""
    hip, shoulder, chest = draw(44, 60), draw(34, 44), draw(9, 13)
    top = hip + shoulder
    torso = limb(
        [(0, 0, hip), (draw(-2, 2), 0, hip + 0.5 * shoulder), (0, 0, top - 8)], [chest, chest * draw(0.75, 1.1), chest]
    )
    skull = draw(8, 13)
    face = top + skull * draw(0.9, 1.3)
    head = ellipsoid((draw(-1, 3), 0, face), (skull * draw(0.9, 1.05), skull * draw(0.8, 1), skull * draw(1, 1.25)))
    neck = limb([(0, 0, top - 10), (1, 0, face)], [6, 5])
    arm, wide = draw(3.2, 5), chest + draw(1, 5)
    arms = []
    for side in LEFT_AND_RIGHT:
        elbow = (draw(-8, 14), side * (wide + draw(4, 14)), top - draw(8, 22))
        wrist = (elbow[0] + draw(0, 16), elbow[1] + side * draw(-14, 8), elbow[2] + draw(-18, 20))
        arms.append(limb([(0, side * wide * 0.7, top - 10), elbow, wrist], [arm * 1.4, arm, arm * 0.95]))
    if draw.maybe(0.35):
        hem, waist = draw(15, 24), chest * draw(0.8, 1)
        lower = [limb([(0, 0, 6), (0, 0, 0.5 * hip), (0, 0, hip)], [hem, hem * draw(0.6, 0.8), waist])]
    else:
        leg, stride = draw(5, 7.5), draw(-14, 14)
        lower = [
            limb(
                [(0, s * 6, hip - 2), (s * stride * 0.5 + draw(0, 5), s * 8, 0.5 * hip), (s * stride, s * 9, 5)],
                [leg * 1.5, leg, leg * 0.8],
            )
            for s in LEFT_AND_RIGHT
        ]
        lower += [
            limb([(s * stride, s * 9, 3.5), (s * stride + draw(8, 13), s * 11, 3)], [4, 3.5]) for s in LEFT_AND_RIGHT
        ]
    whole = joined(draw(2, 4), joined(6, torso, neck, *lower), head, *arms)
    if draw.maybe(0.4):
        whole = joined(2, whole, common(2, ellipsoid((0, 0, 0), (draw(22, 30), draw(20, 28), 6)), above(-1)))
    whole = rippled(moved(whole, (0, 0, -55)), draw, draw(0.1, 0.5), draw(10, 24))
    return twisted(whole, draw(-0.25, 0.25))


def bust(draw: Draw) -> Field:
    """A head with hair, nose, eye sockets and chin, on shoulders and a foot."""
    skull, wide, long = draw(20, 26), draw(17, 22), draw(25, 32)
    head = ellipsoid((0, 0, 40), (skull, wide, long))
    jaw = ellipsoid((0.35 * skull, 0, 40 - 0.6 * long), (0.6 * skull, draw(8, 13), draw(7, 11)))
    nose = limb([(0.95 * skull, 0, 44), (skull + draw(0, 4), 0, 35)], [2.5, draw(3.2, 4.5)])
    brow = limb([(0.8 * skull, -9, 47), (0.97 * skull, 0, 47 + draw(-1, 2)), (0.8 * skull, 9, 47)], [3, 3, 3])
    lips = [
        limb([(0.85 * skull, -4, z), (0.97 * skull, 0, z), (0.85 * skull, 4, z)], [2, draw(2.2, 3), 2])
        for z in (28, 24)
    ]
    ears = [ellipsoid((-1, s * wide, 40), (draw(4, 6), 3, draw(6, 9))) for s in LEFT_AND_RIGHT]
    grown = draw(2, 6)
    hair = ellipsoid((-5, 0, 46), (skull * 0.95 + grown, wide + grown * draw(0.4, 1), long * 0.85 + grown))
    hair = rippled(hair, draw, draw(0.5, 1.5), draw(7, 14), octaves=1)
    neck = limb([(-2, 0, 35), (-6, 0, -4)], [draw(10, 13), draw(11, 15)])
    slope = draw(26, 40)
    shoulders = limb([(-6, -slope, -16), (-4, 0, -2), (-6, slope, -16)], [draw(10, 15), draw(13, 18), draw(10, 15)])
    foot = limb([(-5, 0, -18), (-5, 0, -45)], [draw(14, 20), draw(9, 14)])
    turn = twisted(joined(2, joined(4, head, jaw, neck), nose, brow, *lips, *ears, hair), draw(-0.4, 0.4))
    whole = common(3, joined(draw(4, 7), turn, shoulders, foot), above(-46))
    return rippled(moved(whole, (0, 0, -8)), draw, draw(0.05, 0.3), draw(10, 22))


def hand(draw: Draw) -> Field:
    """A palm, a wrist, and fingers stretched, spread or curled."""
    wide, deep, long = draw(17, 23), draw(6.5, 10), draw(20, 27)
    palm = ellipsoid((0, 0, 0), (deep, wide, long))
    wrist = limb([(0, 0, -0.7 * long), (draw(-6, 6), 0, -long - draw(14, 30))], [draw(9, 12), draw(10, 13)])
    fingers, spread, curl = draw.whole(3, 4), draw(0.02, 0.22), draw(-0.2, 1)
    parts = []
    for i in range(fingers):
        off = 2 * i / (fingers - 1) - 1
        y, angle, bend = 0.75 * wide * off, spread * off, curl * draw(0.5, 1.2)
        reach, thick = draw(15, 22) * (1.1 - 0.2 * off * off), draw(3.8, 5.2)
        points = [np.array([0, y, 0.6 * long])]
        for joint in range(3):
            up, azimuth = joint * bend, angle * (1 + joint)
            points.append(
                points[-1]
                + reach
                * (1 - 0.2 * joint)
                * np.array([np.sin(up), np.cos(up) * np.sin(azimuth), np.cos(up) * np.cos(azimuth)])
            )
        parts.append(limb([tuple(p) for p in points], [thick * 1.2, thick * 1.1, thick, thick * 0.85]))
    out = draw(6, 18)
    parts.append(
        limb(
            [(0, 0.5 * wide, -0.5 * long), (draw(2, 12), wide + 0.7 * out, 0), (draw(4, 16), wide + out, draw(10, 22))],
            [7.5, 6, 4.5],
        )
    )
    whole = joined(draw(2, 4), joined(8, palm, wrist), *parts)
    return rippled(moved(whole, (0, 0, -12)), draw, draw(0.1, 0.4), draw(9, 20))
