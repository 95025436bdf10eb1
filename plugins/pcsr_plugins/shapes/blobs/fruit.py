"""Fruit, vegetables and stones: one lump, dented and uneven."""

import numpy as np

from pcsr_plugins.shapes.blobs.sdf import (
    Field,
    bent,
    dented,
    ellipsoid,
    joined,
    limb,
    lobed,
    moved,
    rippled,
    turned,
)
from pcsr_plugins.shapes.shared.draw import Draw


def _stalk(draw: Draw, height: float) -> Field:
    end = (draw(-9, 9), draw(-9, 9), height + draw(8, 18))
    return limb([(0, 0, height - 10), (draw(-2, 2), draw(-2, 2), height + 2), end], [3, draw(1.8, 2.6), draw(2, 3.5)])


def stone_fruit(draw: Draw) -> Field:
    """Apple, cherry or plum: dimples above and below, a stalk, a leaf or a furrow."""
    wide, high = draw(24, 40), draw(20, 38)
    body = ellipsoid((0, 0, 0), (wide, wide * draw(0.9, 1.08), high))
    hollow = draw(7, 14)
    dimples = [ellipsoid((0, 0, side * (high + draw(-1, 5))), (hollow, hollow, draw(6, 11))) for side in (-1, 1)]
    body = dented(draw(7, 13), body, *dimples)
    if draw.maybe():
        turn = np.linspace(-1.2, 1.2, 5)
        seam = [(1.02 * wide * np.cos(t), 0, 1.02 * high * np.sin(t)) for t in turn]
        body = dented(6, body, limb(seam, [2, 3, draw(3, 4.5), 3, 2]))
    if draw.maybe(0.6):
        body = joined(2.5, body, _stalk(draw, high - 4))
    if draw.maybe(0.3):
        leaf = ellipsoid((0, 0, 0), (draw(11, 17), draw(6, 9), 3))
        body = joined(2.5, body, moved(turned(leaf, draw(-25, 25), axis=1), (11, 0, high - 1)))
    return rippled(body, draw, draw(0.1, 0.7), draw(18, 60))


def pear(draw: Draw) -> Field:
    """Pear, lemon, aubergine, banana: a long lump of changing girth, straight or bent."""
    long, belly, neck = draw(26, 46), draw(16, 28), draw(6, 16)
    points = [(0, 0, -long), (0, 0, -0.3 * long), (0, 0, 0.4 * long), (0, 0, long)]
    body = limb(points, [belly * draw(0.5, 0.9), belly, 0.5 * (belly + neck), neck])
    for side in (-1, 1):
        if draw.maybe():
            body = joined(8, body, limb([(0, 0, side * long), (0, 0, side * (long + draw(8, 22)))], [6, draw(2, 5)]))
    body = bent(body, draw(-18, 18), 40, along=2, towards=0)
    if draw.maybe(0.3):
        body = lobed(body, draw.whole(4, 7), draw(0.4, 1.5), 8)
    return rippled(body, draw, draw(0.1, 0.9), draw(12, 50))


def gourd(draw: Draw) -> Field:
    """Pumpkin or pepper: ribs from pole to pole, a hollow on top, a stalk."""
    wide, high = draw(26, 44), draw(20, 48)
    body = limb([(0, 0, -0.5 * high), (0, 0, 0.5 * high)], [0.7 * wide * draw(0.5, 1), 0.7 * wide])
    body = joined(10, body, ellipsoid((0, 0, 0), (wide, wide, 0.7 * high)))
    body = lobed(body, draw.whole(3, 11), draw(1, 3.2), draw(8, 16))
    top = 0.5 * high + 0.6 * wide
    body = dented(draw(6, 10), body, ellipsoid((0, 0, top + 4), (draw(8, 14), draw(8, 14), draw(10, 16))))
    body = joined(3, body, _stalk(draw, top - 8))
    if draw.maybe(0.3):
        body = bent(body, draw(-14, 14), 50, along=2, towards=0)
    return rippled(body, draw, draw(0.1, 0.6), draw(10, 40))


def pebble(draw: Draw) -> Field:
    """A few lumps grown into one, with hollows; a potato, a bone, a stone from a brook."""
    lumps = [
        ellipsoid((draw(-22, 22), draw(-14, 14), draw(-9, 9)), (draw(14, 30), draw(12, 24), draw(9, 20)))
        for _ in range(draw.whole(2, 4))
    ]
    body = joined(draw(10, 20), *(turned(lump, draw(-40, 40), axis=draw.whole(0, 2)) for lump in lumps))
    hollows = [
        ellipsoid(
            (draw(-40, 40), draw(-36, 36), draw.one_of([-1, 1]) * draw(16, 30)), (draw(8, 18), draw(8, 18), draw(8, 14))
        )
        for _ in range(draw.whole(0, 4))
    ]
    if hollows:
        body = dented(draw(4, 9), body, *hollows)
    return rippled(body, draw, draw(0.3, 1.6), draw(16, 50), octaves=3)
