"""Guess of an object's whole surface from a cloud, and candidates of touches on it."""

import numpy as np
from jaxtyping import Bool, Float, Int

from pcsr.contracts import Fingertip, TouchCandidates
from pcsr.exploration.far_side import far_side, seen_from
from pcsr.exploration.far_side.image import PITCH
from pcsr.exploration.surface import KnownSurface

HIDDEN = 1.5
"""The guessed far side stands for the surface where it is farther than this from every known point, in spacings."""
FLAT = 1.5
"""A cloud that is thinner than this, in spacings, hides nothing: it is a sheet."""
BESIDE = 6
"""Neighbours of a known point between which the surface is drawn."""
GRAZING = 0.3
"""Up to this cosine between normal and direction of the camera, it is uncertain which side the camera saw."""
SURFACE = 512
"""Number of points that are drawn from the whole surface, over which errors are averaged."""
COLUMN = 2.0
"""Radius in mm of the column above a point that is searched for other points."""


def direction(
    known: KnownSurface, towards: Float[np.ndarray, "3"] | None, fingertip: Fingertip
) -> Float[np.ndarray, "3"] | None:
    """Return the unit vector towards the camera, estimated if it is not given; None if no far side is guessed.

    The far side is guessed of objects alone of which a pixel of the guess is smaller than the gel, not of scenes.
    """
    if PITCH * float(np.ptp(known.points, axis=0).max()) / 2 > min(fingertip.gel):
        return None
    return seen_from(known.points[: known.seen]) if towards is None else towards


def guessed_candidates(
    known: KnownSurface,
    towards: Float[np.ndarray, "3"] | None,
    count: int,
    fingertip: Fingertip,
    rng: np.random.Generator,
) -> tuple[TouchCandidates, Bool[np.ndarray, " p"]]:
    """Draw candidates evenly from the known surface and from the guess of the hidden one.

    The sensor stands along the normal, on the side of the camera; where the camera is unknown, the normal is at right
    angles to its direction, or the point was touched, on the side with fewer known points in its way.

    Args:
        known: the known surface.
        towards: unit vector towards the camera; None if no far side is guessed.
        count: number of candidates.
        fingertip: outline of the sensor, whose middle press is taken.
        rng: source of randomness.

    Returns:
        The candidates, and which of them are on the guessed surface.
    """
    hidden, outwards, areas = hidden_surface(known, towards)
    share = areas.sum() / (areas.sum() + known.area)
    guessed = min(round(share * count), len(hidden))
    rows = rng.choice(len(known.points), min(count - guessed, len(known.points)), replace=False)
    picked = rng.choice(len(hidden), guessed, replace=False, p=areas / areas.sum()) if guessed else np.zeros(0, int)
    points = np.concatenate([known.points[rows], hidden[picked]])
    normals = np.concatenate([_outwards(known, rows, towards), outwards[picked]])
    frames = _frames(normals, rng.uniform(0, 2 * np.pi, len(points)))
    presses = np.full(len(points), sum(fingertip.press) / 2)
    of_hidden = round(share * SURFACE) if len(hidden) else 0
    drawn = rng.choice(len(hidden), of_hidden, p=areas / areas.sum()) if of_hidden else np.zeros(0, int)
    surface = np.concatenate([_between(known, SURFACE - of_hidden, rng), hidden[drawn]])
    return TouchCandidates(points, frames, presses, fingertip, surface), np.arange(len(points)) >= len(rows)


def hidden_surface(
    known: KnownSurface, towards: Float[np.ndarray, "3"] | None
) -> tuple[Float[np.ndarray, "h 3"], Float[np.ndarray, "h 3"], Float[np.ndarray, " h"]]:
    """Guess the hidden surface: points of the far side that are far from known points, with normals and areas.

    There is none if the cloud is flat, or was seen from several sides, so that no direction is given.
    """
    seen = known.points[: known.seen]
    spacing = float(np.median(known.spacing))
    thickness = float(np.ptp((seen - seen.mean(0)) @ np.linalg.eigh(np.cov(seen.T))[1][:, 0]))
    if towards is None or thickness < FLAT * spacing:
        return np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0)
    found = far_side(seen, known.points[known.seen :], towards)
    distance, _ = known.tree.query(found.points)
    _, nearest = known.thinned.query(found.points)
    far = distance > HIDDEN * np.maximum(known.spacing[nearest], spacing)
    return found.points[far], found.normals[far], found.areas[far]


def _between(known: KnownSurface, count: int, rng: np.random.Generator) -> Float[np.ndarray, "count 3"]:
    """Draw points of the known surface between its points, evenly by area: on triangles of neighbours."""
    rows = rng.choice(len(known.points), count, p=known.spacing**2 / (known.spacing**2).sum())
    _, around = known.thinned.query(known.points[rows], k=BESIDE + 1)
    corners = np.take_along_axis(around, rng.permuted(np.tile(np.arange(1, BESIDE + 1), (count, 1)), axis=1)[:, :2], 1)
    weights = rng.dirichlet(np.ones(3), count)
    triangles = known.points[np.column_stack([rows, corners])]
    drawn: Float[np.ndarray, "count 3"] = np.einsum("nk,nkj->nj", weights, triangles)
    return drawn


def _outwards(
    known: KnownSurface, rows: Int[np.ndarray, " k"], towards: Float[np.ndarray, "3"] | None
) -> Float[np.ndarray, "k 3"]:
    """Return the normals of known points, towards the camera or to the side with fewer known points above them."""
    normals: Float[np.ndarray, "k 3"] = known.normals[rows].copy()
    away = np.einsum("kj,kj->k", normals, known.points[rows] - known.points.mean(0)) >= 0
    for k, row in enumerate(rows.tolist()):
        cosine = 0.0 if towards is None or row >= known.seen else float(normals[k] @ towards)
        if abs(cosine) > GRAZING:
            normals[k] *= np.sign(cosine)
            continue
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
