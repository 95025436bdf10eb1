"""Animals as toys and statuettes show them. They face along +x and stand on z = 0, some mm more or less."""

import numpy as np

from pcsr_plugins.shapes.blobs.sdf import Field, above, bent, common, ellipsoid, joined, limb, moved, rippled
from pcsr_plugins.shapes.shared.draw import Draw

LEFT_AND_RIGHT = (-1, 1)


def _coat(body: Field, draw: Draw) -> Field:
    """Fur, folds or nothing."""
    if draw.maybe(0.3):
        return body
    return rippled(body, draw, draw(0.15, 0.6), draw(14, 40), octaves=draw.whole(1, 3))


def quadruped(draw: Draw) -> Field:
    """Four legs, a neck, a head with ears, horns or a trunk; long or short in each."""
    half, girth, leg = draw(22, 38), draw(9, 19), draw(16, 42)
    back = leg + girth
    body = limb(
        [(-half, 0, back), (0, 0, back + draw(-5, 4)), (half, 0, back + draw(-2, 6))],
        [girth * draw(0.75, 1), girth * draw(0.8, 1.15), girth * draw(0.75, 1)],
    )
    thick, foot, apart = draw(4, 7.5), draw(3, 5.5), girth * draw(0.45, 0.7)
    legs = [
        limb(
            [
                (x, side * apart, back - 2),
                (x + draw(-5, 5), side * apart * 1.1, 0.5 * leg),
                (x + draw(-7, 7), side * apart, foot),
            ],
            [thick * 1.4, thick, foot],
        )
        for x in (-half + 2, half - 2)
        for side in LEFT_AND_RIGHT
    ]
    neck, rise, throat = draw(6, 26), draw(0, 34), girth * draw(0.45, 0.7)
    x, z = half + neck, back + rise
    nape = limb(
        [(half - 2, 0, back + 3), (half + 0.7 * neck, 0, back + 0.6 * rise), (x, 0, z)], [throat * 1.4, throat, throat]
    )
    skull, drop = draw(7, 12), np.radians(draw(0, 60))
    muzzle = skull * draw(1.1, 2.4)
    nose = (x + muzzle * np.cos(drop), 0, z - muzzle * np.sin(drop))
    head = limb([(x, 0, z), nose], [skull, skull * draw(0.4, 0.75)])
    parts = [_tail(draw, half, back)]
    kind = draw.one_of(["ears", "large ears", "horns", "trunk"])
    for side in LEFT_AND_RIGHT:
        y = side * skull
        if kind in ("large ears", "trunk"):
            parts.append(ellipsoid((x - 2, 1.3 * y, z + 1), (draw(5, 8), draw(3, 4), draw(7, 11))))
        else:
            parts.append(limb([(x, 0.6 * y, z + 0.6 * skull), (x - 2, 1.1 * y, z + skull * draw(1.3, 1.8))], [3, 2]))
        if kind == "horns":
            tip = (x + draw(0, 8), y * draw(1, 2), z + skull * draw(1.6, 2.4))
            parts.append(limb([(x + 2, 0.5 * y, z + 0.7 * skull), (x, 1.5 * y, z + 1.3 * skull), tip], [2.8, 2.4, 1.5]))
    if kind == "trunk":
        end = (nose[0] + draw(2, 14), draw(-6, 6), max(nose[2] - draw(20, 32), 4))
        parts.append(limb([nose, (nose[0] + 6, 0, nose[2] - 10), end], [skull * 0.5, 4, 2.8]))
    humps = [
        ellipsoid((place, 0, back + 0.8 * girth), (draw(6, 10), draw(5, 8), draw(8, 12)))
        for place in draw.one_of([(), (), (), (0,), (-12, 12)])
    ]
    torso = joined(draw(6, 12), body, *legs, nape, *humps)
    return moved(_coat(joined(draw(2, 5), torso, head, *parts), draw), (0, 0, -back))


def _tail(draw: Draw, half: float, back: float) -> Field:
    length, thick = draw(8, 34), draw(2, 5)
    middle = (-half - draw(8, 14), draw(-5, 5), back + draw(-4, 8))
    end = (-half - draw(10, 18), draw(-10, 10), back + length * draw.one_of([-0.6, 0.6]))
    return limb([(-half - 2, 0, back + 3), middle, end], [thick + 2, thick, thick * draw(0.8, 1.4)])


def bird(draw: Draw) -> Field:
    """A body with a raised tail, a curved neck, a beak, and wings that lie close."""
    long, wide, high = draw(24, 38), draw(14, 22), draw(14, 22)
    body = ellipsoid((0, 0, 0), (long, wide, high))
    tail = limb([(-0.6 * long, 0, 2), (-long - draw(4, 18), 0, draw(4, 20))], [0.55 * high, draw(2.5, 5)])
    reach, rise, thick = draw(4, 16), draw(16, 48), draw(5, 9)
    x, z = 0.65 * long + reach, 0.3 * high + rise
    neck = limb(
        [(0.6 * long, 0, 0.3 * high), (0.75 * long + draw(-4, 8), 0, 0.3 * high + 0.5 * rise), (x, 0, z)],
        [thick * 1.6, thick, thick],
    )
    skull = thick * draw(1.2, 1.7)
    head = ellipsoid((x + 2, 0, z), (skull * draw(1, 1.3), skull, skull))
    bill = draw(6, 20)
    beak = limb([(x + skull, 0, z - 1), (x + skull + bill, 0, z - draw(0, 6))], [draw(3, 4.5), draw(1.8, 3.2)])
    wings = [
        ellipsoid((-0.15 * long, side * 0.85 * wide, 0.2 * high), (0.7 * long, draw(3.5, 6), 0.55 * high))
        for side in LEFT_AND_RIGHT
    ]
    whole = joined(draw(3, 7), joined(10, body, neck, tail), head)
    whole = joined(draw(1.5, 3), whole, beak, *wings)
    if draw.maybe():
        leg, thigh = draw(10, 22), draw(2.5, 4)
        legs = [
            limb(
                [
                    (draw(-4, 6), s * 0.4 * wide, 0),
                    (4, s * 0.45 * wide, -high - leg),
                    (14, s * 0.5 * wide, -high - leg),
                ],
                [2 * thigh, thigh, thigh],
            )
            for s in LEFT_AND_RIGHT
        ]
        whole = joined(4, whole, *legs)
    else:
        whole = common(4, whole, above(-draw(0.55, 0.9) * high))
    return _coat(whole, draw)


def fish(draw: Draw) -> Field:
    """A flat body, bent as if swimming, with fins."""
    long, wide, high = draw(34, 52), draw(9, 16), draw(14, 28)
    body = ellipsoid((0, 0, 0), (long, wide, high))
    stem = limb([(-0.7 * long, 0, 0), (-long - 6, 0, 0)], [0.4 * high, draw(4, 6)])
    span, thin = draw(14, 26), draw(3, 4.2)
    lobes = [
        limb([(-long - 4, 0, 0), (-long - draw(10, 20), 0, side * span)], [thin * 2, thin]) for side in LEFT_AND_RIGHT
    ]
    webbing = ellipsoid((-long - 8, 0, 0), (8, thin, 0.7 * span))
    back = ellipsoid((draw(-10, 8), 0, 0.9 * high), (draw(10, 18), thin, draw(7, 14)))
    belly = ellipsoid((draw(-14, 0), 0, -0.9 * high), (draw(6, 10), thin, draw(6, 10)))
    arm = draw(8, 18)
    fins = [
        limb([(0.3 * long, s * 0.7 * wide, -3), (0.3 * long - arm, s * (wide + arm * 0.7), -7)], [4.5, thin])
        for s in LEFT_AND_RIGHT
    ]
    mouth = limb([(0.8 * long, 0, 0), (long + draw(0, 8), 0, draw(-3, 3))], [0.4 * wide, draw(3, 5)])
    whole = joined(draw(4, 7), joined(8, body, stem, mouth), *lobes, webbing, back, belly, *fins)
    return _coat(bent(whole, draw(-14, 14), 60, along=0, towards=1), draw)


def seated_animal(draw: Draw) -> Field:
    """Upright on its haunches: a round head with ears, forelegs to the ground, a tail around the body."""
    base, tall = draw(17, 25), draw(34, 54)
    trunk = limb(
        [(-2, 0, base), (2, 0, 0.5 * (base + tall)), (6, 0, tall)], [base, base * draw(0.7, 0.9), base * draw(0.5, 0.7)]
    )
    skull = draw(12, 19)
    x, z = 8 + draw(0, 6), tall + skull * draw(0.7, 1)
    head = ellipsoid((x, draw(-3, 3), z), (skull, skull * draw(0.9, 1.15), skull * draw(0.8, 1)))
    snout = ellipsoid((x + 0.85 * skull, 0, z - 0.25 * skull), (skull * draw(0.3, 0.7), 0.45 * skull, 0.38 * skull))
    ear, tip, lean = draw(8, 26), draw(2, 4), draw(0.4, 1)
    thigh, paw = draw(9, 13), draw(4, 6)
    parts = []
    for side in LEFT_AND_RIGHT:
        parts += [
            limb(
                [(x - 2, side * 0.55 * skull, z + 0.6 * skull), (x - 3, side * lean * skull, z + 0.7 * skull + ear)],
                [5, tip],
            ),
            ellipsoid((2, side * 0.8 * base, 0.7 * thigh + 2), (thigh * 1.3, thigh * 0.7, thigh)),
            limb(
                [(9, side * 0.5 * base, 0.75 * tall), (16, side * 8, 0.4 * tall), (17 + draw(0, 4), side * 8, paw)],
                [paw + 2, paw, paw],
            ),
            limb([(10, side * 0.8 * base, 5), (base + draw(2, 8), side * base, 4)], [paw, paw]),
        ]
    side_sign = draw.one_of([-1, 1])
    curl = [
        (-base, 0, 7),
        (-base - draw(4, 14), side_sign * 12, draw(5, 16)),
        (-6 - draw(0, 10), side_sign * (base + draw(7, 14)), draw(5, 24)),
    ]
    tail = limb(curl, [6, draw(3.5, 6), draw(3, 5)])
    whole = joined(draw(2, 4), joined(5, trunk, head), snout, *parts, tail)
    return moved(_coat(common(3, whole, above(0)), draw), (0, 0, -45))


def tortoise(draw: Draw) -> Field:
    """A domed back with bumps, short legs, head and tail."""
    long, wide, dome = draw(28, 44), draw(22, 36), draw(16, 30)
    shell = common(4, ellipsoid((0, 0, 4), (long, wide, dome)), above(3))
    rows = draw.whole(3, 5)
    positions = [(draw(-0.62, 0.62), draw(-0.62, 0.62)) for _ in range(3 * rows)]
    bumps = [
        ellipsoid((long * a, wide * b, 4 + dome * np.sqrt(1 - a * a - b * b)), (r, r, 0.6 * r))
        for a, b in positions
        for r in [draw(3.5, 7)]
    ]
    leg, foot, reach = draw(6, 9), draw(3.5, 6), draw(0.7, 1.05)
    legs = [
        limb(
            [
                (a * 0.55 * long, b * 0.55 * wide, 6),
                (a * reach * 0.9 * long, b * reach * 0.85 * wide, 0),
                (a * reach * long, b * reach * wide, -6),
            ],
            [leg, leg, foot],
        )
        for a in LEFT_AND_RIGHT
        for b in LEFT_AND_RIGHT
    ]
    neck, skull = draw(8, 22), draw(6, 9.5)
    head = limb([(0.7 * long, 0, 7), (long + neck, draw(-8, 8), 8 + draw(0, 14))], [skull * 0.8, skull])
    tail = limb([(-0.8 * long, 0, 6), (-long - draw(3, 12), 0, 3)], [4, 2.5])
    whole = joined(draw(2, 4), shell, ellipsoid((0, 0, 4), (0.9 * long, 0.9 * wide, 7)), *legs, head, tail)
    return _coat(joined(draw(1.5, 4), whole, *bumps), draw)
