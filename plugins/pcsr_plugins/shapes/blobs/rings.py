"""Bodies with holes through them: rings, links, knots."""

import numpy as np

from pcsr_plugins.shapes.blobs.sdf import (
    Field,
    above,
    bent,
    common,
    ellipsoid,
    joined,
    limb,
    lobed,
    moved,
    ring,
    rippled,
    turned,
)
from pcsr_plugins.shapes.shared.draw import Draw


def ring_body(draw: Draw) -> Field:
    """A ring that is no circle and nowhere as thick as elsewhere; a bagel, a teether, a bangle."""
    around, wide, long = draw.whole(6, 10), draw(24, 40), draw(0.75, 1.3)
    low = draw(5, 10)
    turns = 2 * np.pi * np.arange(around) / around
    points = [(wide * draw(0.9, 1.1) * long * np.cos(t), wide * draw(0.9, 1.1) * np.sin(t), draw(-7, 7)) for t in turns]
    whole = limb(points, [low * draw(0.9, 1.6) for _ in turns], closed=True)
    beads = [ellipsoid(points[i], (draw(8, 14), draw(8, 14), draw(8, 14))) for i in range(draw.whole(0, 3))]
    whole = joined(draw(3, 7), whole, *beads)
    if draw.maybe(0.3):
        whole = bent(whole, draw(-18, 18), 45, along=0, towards=2)
    return rippled(whole, draw, draw(0.1, 0.7), draw(10, 36))


def loops(draw: Draw) -> Field:
    """Two or three rings that flow into one another, in a row or a clover."""
    count, wide, thick = draw.whole(2, 3), draw(15, 23), draw(5, 8.5)
    clover = count == 3 and draw.maybe()
    rings = []
    for i in range(count):
        if clover:
            turn = 2 * np.pi * i / 3 + draw(-0.1, 0.1)
            far = 1.16 * (wide + 0.45 * thick)
            place = (far * np.cos(turn), far * np.sin(turn), 0)
        else:
            place = ((i - (count - 1) / 2) * 2 * (wide + 0.4 * thick), draw(-6, 6), 0)
        rings.append(
            moved(turned(ring((0, 0, 0), wide * draw(0.9, 1), thick * draw(0.9, 1.1)), draw(-28, 28), axis=0), place)
        )
    whole = bent(joined(draw(5, 9), *rings), draw(-14, 20), 50, along=0, towards=2)
    return rippled(whole, draw, draw(0.1, 0.6), draw(10, 36))


def knot(draw: Draw) -> Field:
    """A thread wound around a ring, once through the hole for each winding, and closed."""
    windings, wide, high = draw.one_of([3, 5]), draw(24, 32), draw(12, 19)
    thick = draw(0.26, 0.36) * high
    turns = 4 * np.pi * np.arange(12 * 2) / (12 * 2)
    away = wide + high * draw(0.75, 1) * np.cos(windings * turns / 2)
    points = np.stack([away * np.cos(turns), away * np.sin(turns), high * np.sin(windings * turns / 2)], axis=1)
    whole = limb([tuple(p) for p in points], [thick * draw(0.85, 1.1) for _ in points], closed=True)
    return rippled(whole, draw, draw(0.1, 0.4), draw(10, 30))


def kettlebell(draw: Draw) -> Field:
    """A heavy body with one or two handles: a weight, a padlock, a bag, a basket."""
    wide, deep, high = draw(22, 36), draw(16, 30), draw(18, 34)
    body = common(draw(4, 9), ellipsoid((0, 0, 0), (wide, deep, high)), above(-high * draw(0.6, 0.95)))
    if draw.maybe(0.3):
        body = lobed(body, draw.whole(3, 8), draw(0.6, 1.8), 12)
    thick, reach, half = draw(3.6, 6), draw(14, 34), draw(0.45, 0.75) * wide
    apart = 0.5 * deep + thick
    handles = []
    for y in draw.one_of([(0.0,), (0.0,), (-apart, apart)]):
        shoulder = 0.8 * high + 0.6 * reach
        points = [
            (-half, y, 0.4 * high),
            (-half * draw(1, 1.3), y * 1.2, shoulder),
            (draw(-4, 4), y * 1.2, high + reach),
            (half * draw(1, 1.3), y * 1.2, shoulder),
            (half, y, 0.4 * high),
        ]
        handles.append(limb(points, [thick * 1.3, thick, thick * draw(0.8, 1.3), thick, thick * 1.3]))
    whole = joined(draw(3, 6), body, *handles)
    return rippled(moved(whole, (0, 0, -0.4 * reach)), draw, draw(0.1, 0.6), draw(12, 40))
