"""Guess of an object's whole surface from a cloud, and candidates of touches on it."""

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import ConvexHull, QhullError

from pcsr.contracts import Fingertip, TouchCandidates
from pcsr.exploration.surface import KnownSurface
from pcsr.geometry.sampling import face_by_area, point_of_face

HIDDEN = 3.0
"""The convex hull stands for the surface where it is farther than this from every known point, in spacings."""
COLUMN = 2.0
"""Radius in mm of the column above a point that is searched for other points."""
MOST = 4096
"""Largest number of points of the hull that are looked at."""


def guessed_candidates(
    known: KnownSurface, count: int, fingertip: Fingertip, rng: np.random.Generator
) -> tuple[TouchCandidates, Bool[np.ndarray, " p"]]:
    """Draw candidates evenly from the known surface and from the guess of the hidden one.

    The guess is the convex hull of the known points, where it is far from them. The sensor stands along the normal, on
    the side with fewer known points in its way.

    Args:
        known: the known surface.
        count: number of candidates.
        fingertip: outline of the sensor, whose middle press is taken.
        rng: source of randomness.

    Returns:
        The candidates, and which of them are on the guessed surface.
    """
    hidden, outwards, area = hidden_surface(known, rng)
    share = area / (area + known.area)
    guessed = min(round(share * count), len(hidden))
    rows = rng.choice(len(known.points), min(count - guessed, len(known.points)), replace=False)
    picked = rng.choice(len(hidden), guessed, replace=False)
    points = np.concatenate([known.points[rows], hidden[picked]])
    normals = np.concatenate([_outwards(known, rows), outwards[picked]])
    frames = _frames(normals, rng.uniform(0, 2 * np.pi, len(points)))
    presses = np.full(len(points), sum(fingertip.press) / 2)
    return TouchCandidates(points, frames, presses, fingertip), np.arange(len(points)) >= len(rows)


def hidden_surface(
    known: KnownSurface, rng: np.random.Generator
) -> tuple[Float[np.ndarray, "h 3"], Float[np.ndarray, "h 3"], float]:
    """Guess the hidden surface: random points of the convex hull far from known points, with normals, and their area.

    A flat cloud has none.
    """
    nothing = np.zeros((0, 3))
    try:
        hull = ConvexHull(known.points)
    except QhullError:  # all points on a plane
        return nothing, nothing, 0.0
    corners = known.points[hull.simplices]
    edges = corners[:, 1:] - corners[:, :1]
    double = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    if not double.sum() > 0:
        return nothing, nothing, 0.0
    faces = face_by_area(np.cumsum(double) / double.sum(), rng.random(MOST))
    points = point_of_face(corners[faces, 0], edges[faces], rng.random((MOST, 2)))
    distance, _ = known.tree.query(points)
    _, nearest = known.thinned.query(points)
    far = distance > HIDDEN * np.maximum(known.spacing[nearest], np.median(known.spacing))
    return points[far], hull.equations[faces[far], :3], float(double.sum() / 2 * far.mean())


def _outwards(known: KnownSurface, rows: Int[np.ndarray, " k"]) -> Float[np.ndarray, "k 3"]:
    """Return the normals of known points on the side with fewer known points above them, or away from the centroid."""
    normals: Float[np.ndarray, "k 3"] = known.normals[rows].copy()
    away = np.einsum("kj,kj->k", normals, known.points[rows] - known.points.mean(0)) >= 0
    for k, row in enumerate(rows.tolist()):
        relative = known.points - known.points[row]
        heights = relative @ normals[k]
        column = np.einsum("nj,nj->n", relative, relative) - heights**2 < COLUMN**2
        above, below = int((column & (heights > COLUMN)).sum()), int((column & (heights < -COLUMN)).sum())
        if above > below or (above == below and not away[k]):
            normals[k] *= -1
    return normals


def _frames(normals: Float[np.ndarray, "p 3"], yaw: Float[np.ndarray, " p"]) -> Float[np.ndarray, "p 3 3"]:
    """Return axes as columns: z along the normals, turned about them."""
    across = np.cross(np.eye(3)[np.abs(normals).argmin(1)], normals)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    x = np.cos(yaw)[:, None] * across + np.sin(yaw)[:, None] * np.cross(normals, across)
    return np.stack([x, np.cross(normals, x), normals], axis=-1)
