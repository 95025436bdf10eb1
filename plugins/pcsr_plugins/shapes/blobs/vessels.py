"""Pots, cups and bottles: turned by hand, so never quite round. They stand upright."""

import numpy as np
from jaxtyping import Float

from pcsr_plugins.shapes.blobs.sdf import (
    Field,
    above,
    below,
    common,
    dented,
    ellipsoid,
    joined,
    limb,
    lobed,
    moved,
    rippled,
    shrunk,
    twisted,
)
from pcsr_plugins.shapes.shared.draw import Draw


def _turned(draw: Draw, radii: list[float], height: float) -> Field:
    """An endless body of rotation, of given radii at equal steps upwards to `height`; dented, and in some ribbed."""
    levels = np.linspace(0, height, len(radii))
    body = limb([(0, 0, z) for z in (-40, *levels, height + 40)], [radii[0], *radii, radii[-1]])
    if draw.maybe(0.35):
        body = twisted(lobed(body, draw.whole(3, 12), draw(0.4, 1.2), draw(10, 20)), draw(-1, 1))
    return rippled(body, draw, draw(0.1, 0.7), draw(16, 60))


def _open(body: Field, wall: float, height: float) -> Field:
    """A vessel of an endless body: with a wall and a floor as thick, and a rim at `height`."""

    def value(at: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        skin = body(at)  # once, for both sides of the wall
        outside = common(5, lambda _: skin, above(0), below(height))
        return dented(4, outside, common(4, lambda _: skin + wall, above(wall)))(at)

    return value


def _handle(draw: Draw, side: int, top: float, bottom: float, wall: float) -> Field:
    """From the wall at one height to the wall at another."""
    out, thick = draw(14, 24), draw(3, 4.8)
    points = [
        (side * x, 0, z)
        for x, z in [
            (wall - 4, top),
            (wall + out, top + draw(-4, 6)),
            (wall + out * draw(0.7, 1), bottom + draw(0, 8)),
            (wall - 4, bottom),
        ]
    ]
    return limb(points, [thick, thick, thick * draw(0.8, 1.1), thick])


def bottle(draw: Draw) -> Field:
    """A closed bottle with shoulders, a neck and a stopper, dented where it is held."""
    tall, body, neck = draw(80, 130), draw(15, 26), draw(5, 9)
    profile = [body * draw(0.9, 1), body * draw(0.8, 1.05), body, 0.5 * (body + neck), neck, neck]
    whole = common(5, _turned(draw, profile, tall - neck), above(0), below(tall - 4))
    whole = joined(
        draw(1.5, 3),
        whole,
        limb([(0, 0, tall - 6), (0, 0, tall + draw(0, 6))], [neck * draw(1.1, 1.6), neck * draw(1, 1.5)]),
    )
    grips = [
        ellipsoid((s * (body + draw(3, 7)), 0, tall * draw(0.25, 0.45)), (draw(7, 10), draw(9, 16), draw(10, 18)))
        for s in draw.one_of([(), (-1, 1), (1,)])
    ]
    return moved(dented(4, whole, *grips) if grips else whole, (0, 0, -tall / 2))


def vase(draw: Draw) -> Field:
    """Open above, slender or bulging, of three to five radii."""
    tall = draw(60, 120)
    radii = [draw(16, 32) for _ in range(draw.whole(3, 5))]
    whole = _open(_turned(draw, radii, tall), draw(7, 9), tall)
    if draw.maybe(0.3):
        whole = joined(3, whole, *(_handle(draw, s, 0.75 * tall, 0.3 * tall, min(radii)) for s in (-1, 1)))
    return moved(whole, (0, 0, -tall / 2))


def cup(draw: Draw) -> Field:
    """A mug or a bowl with a thick wall, with a handle or none."""
    tall, foot, rim, wall = draw(36, 76), draw(18, 28), draw(24, 40), draw(7, 9)
    middle = 0.5 * (foot + rim) * draw(0.95, 1.15)
    body = _turned(draw, [foot, middle, rim], tall)
    whole = _open(body, wall, tall)
    if draw.maybe(0.7):
        handle = _handle(draw, 1, 0.75 * tall, 0.3 * tall, middle)
        whole = joined(3, whole, dented(2, handle, shrunk(body, wall / 2)))
    return moved(whole, (0, 0, -tall / 2))


def jug(draw: Draw) -> Field:
    """A closed jug or teapot: a belly, a lid with a knob, a spout, and a handle opposite or above."""
    wide, tall = draw(22, 34), draw(40, 70)
    body = _turned(draw, [wide * draw(0.6, 0.9), wide, wide * draw(0.9, 1), wide * draw(0.4, 0.7)], tall)
    lid = ellipsoid((0, 0, tall - 4), (0.75 * wide, 0.75 * wide, 0.5 * wide))
    whole = joined(5, common(5, body, above(0), below(tall)), lid)
    crown = tall + 0.5 * wide - 4
    knob = limb([(0, 0, crown - 12), (0, 0, crown + draw(4, 12))], [draw(5, 8), draw(4, 7)])
    out, up = draw(16, 32), draw(0.5, 1.05) * tall
    spout = limb(
        [(-0.8 * wide, 0, 0.3 * tall), (-wide - 0.6 * out, 0, 0.45 * tall), (-wide - out, 0, up)],
        [draw(7, 10), 5.5, draw(3, 5)],
    )
    if draw.maybe(0.7):
        handle = _handle(draw, 1, 0.85 * tall, 0.3 * tall, 0.9 * wide)
    else:
        high = crown + draw(18, 28)
        handle = limb(
            [
                (0.7 * wide, 0, 0.8 * tall),
                (0.9 * wide, 0, crown + 4),
                (0, 0, high),
                (-0.9 * wide, 0, crown + 4),
                (-0.7 * wide, 0, 0.8 * tall),
            ],
            [4, 4, 3.6, 4, 4],
        )
    return moved(joined(draw(2.5, 5), whole, knob, spout, handle), (0, 0, -crown / 2))
