"""Signed distance fields of smooth bodies: limbs and ellipsoids that flow into one another, dents, bends and detail.

A field is about the distance to the surface in mm, negative inside. Nothing depends on where it is evaluated.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float
from scipy.interpolate import CubicSpline, PchipInterpolator

from pcsr_plugins.shapes.shared.draw import Draw, Number

Field = Callable[[Float[np.ndarray, "n 3"]], Float[np.ndarray, " n"]]
"""Points in mm to values in mm."""

Position = Sequence[Number]
"""x, y and z in mm; z points up."""

PIECES = 4
"""Straight pieces between two points of a limb that bends, among which the nearest is looked for."""

FAR = 15.0
"""Distance in mm beyond which those pieces will do: more than what bodies flow into one another by."""

RIPPLES = 8
"""Waves of one length: fewer look like corrugated sheet."""


def ellipsoid(centre: Position, radii: Position) -> Field:
    """With half axes `radii` along x, y and z."""
    middle, r = np.asarray(centre, float), np.asarray(radii, float)

    def value(at: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        scaled = (at - middle) / r
        far = np.linalg.norm(scaled, axis=1)
        slope = np.linalg.norm(scaled / r, axis=1)
        # First order at the surface; a slope of 0 is the centre alone, where any negative number will do.
        return np.asarray(far * (far - 1) / np.maximum(slope, 1e-9) - r.min() * (slope < 1e-9))

    return value


def limb(points: Sequence[Position], radii: Sequence[Number], closed: bool = False) -> Field:
    """A smooth curve through points, thick by the radius at each; closed, it ends where it begins."""
    through, thick = np.asarray(points, float), np.asarray(radii, float)
    if closed:
        through, thick = np.vstack([through, through[:1]]), np.append(thick, thick[0])
    knots = np.arange(len(through))
    end = float(knots[-1])
    # Without a bend one piece is exact.
    steps = np.linspace(0, end, PIECES * len(knots[1:]) + 1) if len(through) > 2 else knots.astype(float)
    curve = CubicSpline(knots, through, bc_type="periodic" if closed else "natural")
    tangent = curve.derivative()
    # The radii never overshoot, since they must stay positive.
    girth = PchipInterpolator(knots, thick)
    flare = girth.derivative()
    positions, radius = curve(steps), girth(steps)
    middle = positions.mean(axis=0)
    starts, segments = positions[:-1] - middle, np.diff(positions, axis=0)
    squares, widening = (segments**2).sum(axis=1), np.diff(radius)
    # A cone's surface is nearer than the place beside it at the same level.
    steepness = np.sqrt(1 + widening**2 / squares)

    def value(at: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        here = at - middle
        ahead = here @ segments.T - (starts * segments).sum(axis=1)
        along = np.clip(ahead / squares, 0, 1)
        # |here - starts - along * segments|², multiplied out: three numbers fewer for each point and piece.
        square = (here**2).sum(axis=1)[:, None] - 2 * (here @ starts.T) + (starts**2).sum(axis=1)
        square += along * (along * squares - 2 * ahead)
        piece = square.argmin(axis=1)
        far, share = (np.take_along_axis(each, piece[:, None], axis=1)[:, 0] for each in (square, along))
        nearest: Float[np.ndarray, " n"] = np.sqrt(np.maximum(far, 0)) - radius[piece] - share * widening[piece]
        nearest /= steepness[piece]
        if len(through) == 2:
            return nearest
        # From the nearest piece to the curve beside it: without this step the pieces would show.
        close = np.flatnonzero(np.abs(nearest) < FAR)
        when = (piece + share)[close] * steps[1]
        here, direction = at[close], tangent(when)
        when += ((here - curve(when)) * direction).sum(axis=1) / (direction**2).sum(axis=1)
        when = np.mod(when, end) if closed else np.clip(when, 0, end)
        steep = np.sqrt(1 + flare(when) ** 2 / (tangent(when) ** 2).sum(axis=1))
        nearest[close] = (np.linalg.norm(here - curve(when), axis=1) - girth(when)) / steep
        return nearest

    return value


def ring(centre: Position, radius: Number, thick: Number, normal: Position = (0, 0, 1)) -> Field:
    """A torus around the axis `normal`."""
    middle, axis = np.asarray(centre, float), np.asarray(normal, float)
    axis = axis / np.linalg.norm(axis)

    def value(at: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        along = (at - middle) @ axis
        around = np.linalg.norm(at - middle - along[:, None] * axis, axis=1) - radius
        return np.asarray(np.hypot(around, along) - thick)

    return value


def above(height: Number) -> Field:
    """All that is above a horizontal plane: what a foot is cut with."""
    return lambda at: height - at[:, 2]


def below(height: Number) -> Field:
    """All that is below a horizontal plane."""
    return lambda at: at[:, 2] - height


def shrunk(field: Field, by: Number) -> Field:
    """The body without its outermost `by` mm."""
    return lambda at: field(at) + by


def joined(width: Number, *fields: Field) -> Field:
    """Bodies that flow into one another where they are nearer than `width`: Quilez' quadratic smooth minimum."""

    def value(at: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        total = fields[0](at)
        for field in fields[1:]:
            other = field(at)
            overlap = np.maximum(width - np.abs(total - other), 0)
            total = np.minimum(total, other) - overlap**2 / (4 * width)
        return total

    return value


def common(width: Number, *fields: Field) -> Field:
    """What all have in common, with edges rounded by `width`."""
    inverse = joined(width, *(_inverted(field) for field in fields))
    return _inverted(inverse)


def dented(width: Number, body: Field, *dents: Field) -> Field:
    """The body without the dents, with rims rounded by `width`."""
    return common(width, body, *(_inverted(dent) for dent in dents))


def _inverted(field: Field) -> Field:
    return lambda at: -field(at)


def moved(field: Field, by: Position) -> Field:
    """The body elsewhere."""
    shift = np.asarray(by, float)
    return lambda at: field(at - shift)


def turned(field: Field, degrees: Number, axis: int = 2) -> Field:
    """The body turned around a coordinate axis through the origin."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    return lambda at: field(_rotated(at, first, second, np.full(len(at), -np.radians(degrees))))


def twisted(field: Field, degrees: Number) -> Field:
    """The body twisted around the z axis by so many degrees for each mm upwards."""
    return lambda at: field(_rotated(at, 0, 1, -np.radians(degrees) * at[:, 2]))


def _rotated(
    at: Float[np.ndarray, "n 3"], first: int, second: int, angle: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3"]:
    cosine, sine = np.cos(angle), np.sin(angle)
    result = at.copy()
    result[:, first] = cosine * at[:, first] - sine * at[:, second]
    result[:, second] = sine * at[:, first] + cosine * at[:, second]
    return result


def bent(field: Field, sag: Number, length: Number, along: int = 0, towards: int = 2) -> Field:
    """The body bent like a beam: `length` away from the middle it has moved by `sag`."""

    def value(at: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        straight = at.copy()
        straight[:, towards] -= sag * (at[:, along] / length) ** 2
        return field(straight)

    return value


def lobed(field: Field, lobes: int, depth: Number, reach: Number) -> Field:
    """Ribs like a pumpkin's around the z axis, `depth` high and fading within `reach` of the axis."""

    def value(at: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        square = at[:, 0] ** 2 + at[:, 1] ** 2
        fading = square / (square + reach**2)
        return np.asarray(field(at) - depth * fading * np.cos(lobes * np.arctan2(at[:, 1], at[:, 0])))

    return value


def rippled(field: Field, draw: Draw, height: Number, length: Number, octaves: int = 2) -> Field:
    """The body with an uneven surface: waves from all sides, about `height` high and `length` from crest to crest.

    Each further octave is half as long and less than half as high.
    """
    waves, phases, heights = [], [], []
    for octave in range(octaves):
        for _ in range(RIPPLES):
            upwards, angle = draw(-1, 1), np.radians(draw(0, 360))
            level = np.sqrt(1 - upwards**2)
            direction = np.array([level * np.cos(angle), level * np.sin(angle), upwards])
            waves.append(direction * 2 * np.pi * 2**octave / (length * draw(0.8, 1.25)))
            phases.append(np.radians(draw(0, 360)))
            heights.append(height * 0.45**octave / np.sqrt(RIPPLES / 2))
    k, phase, high = np.array(waves), np.array(phases), np.array(heights)
    return lambda at: field(at) - np.sin(at @ k.T + phase) @ high
