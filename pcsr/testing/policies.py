"""Checks of policies, on a ball of which one side is seen."""

import numpy as np
from jaxtyping import Float

from pcsr.contracts import Fingertip, Policy, TouchCandidates
from pcsr.errors import UserError
from pcsr.testing.subject import Subject, pickled

RADIUS = 20.0
"""Radius of the ball in mm."""
SEEN, CANDIDATES, TOUCHED = 256, 24, 64
"""Numbers of points of the cloud, of candidates, and of touched points."""
FEWEST = 16
"""Number of points of the smallest cloud."""
TIP = Fingertip("digit", gel=(16.0, 12.0), housing=(27.0, 18.0), protrusion=2.0)

Scene = tuple[TouchCandidates, Float[np.ndarray, "n 3"], Float[np.ndarray, "f 3"]]


def scene(points: int = SEEN, candidates: int = CANDIDATES, touched: int = TOUCHED) -> Scene:
    """Create candidates, a cloud of the upper half of a ball, and touched points at its lower end."""
    rng = np.random.default_rng(5)

    def directions(count: int) -> Float[np.ndarray, "count 3"]:
        drawn = rng.normal(size=(count, 3))
        unit: Float[np.ndarray, "count 3"] = drawn / np.linalg.norm(drawn, axis=1, keepdims=True)
        return unit

    seen = directions(points)
    seen[:, 2] = np.abs(seen[:, 2])
    normals = directions(candidates)
    across = np.cross(np.eye(3)[np.abs(normals).argmin(1)], normals)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    frames = np.stack([across, np.cross(normals, across), normals], axis=-1)
    presses = rng.uniform(*TIP.press, candidates)
    below = directions(touched) * 0.2 + np.array([0.0, 0.0, -1.0])
    below /= np.linalg.norm(below, axis=1, keepdims=True)
    return TouchCandidates(RADIUS * normals, frames, presses, TIP), RADIUS * seen, RADIUS * below


def scores(subject: Subject) -> None:
    """There is one finite score for each candidate, with touches and without."""
    for candidates, touched in ((CANDIDATES, 0), (CANDIDATES, TOUCHED), (1, TOUCHED)):
        _scored(subject, scene(candidates=candidates, touched=touched))


def repeatable(subject: Subject) -> None:
    """The same arguments give the same scores, from the same instance, another one and a pickled copy."""
    policy = subject.built()
    found = _scored(subject, scene(), policy)
    for what, other in (
        ("itself", policy),
        ("another instance", subject.built()),
        ("a pickled copy", pickled(policy)),
    ):
        if not np.array_equal(found, _scored(subject, scene(), other)):
            raise subject.failure(
                f"{what} gives other scores for the same arguments",
                "the same scores",
                "draw no random numbers: the candidates are random already",
            )


def few_points(subject: Subject) -> None:
    """A cloud of few points is scored too."""
    _scored(subject, scene(points=FEWEST, touched=0))


def expects_gains(subject: Subject) -> None:
    """The expected error is a number from 0 on, or None; with one, no gain is negative."""
    policy, given = subject.built(), scene()
    error = policy.error(*given)
    if error is None:
        return
    if not (isinstance(error, float) and np.isfinite(error) and error >= 0):
        raise subject.failure(
            f"the expected error is {error!r}", "a finite float from 0 on, in mm², or None", "return float(…)"
        )
    gains = _scored(subject, given, policy)
    if gains.min() < 0:
        raise subject.failure(
            f"it expects an error, and scores down to {gains.min():.3g}",
            "scores that are expected gains in mm², from 0 on",
            "return None from `error` if the scores are something else",
        )


def leaves_clouds(subject: Subject) -> None:
    """The candidates and the clouds are not changed."""
    given, before = scene(), scene()
    subject.built().scores(*given)  # not `checked_scores`, whose arrays cannot be changed
    arrays, copies = ((one[0].points, one[0].frames, one[0].presses, one[1], one[2]) for one in (given, before))
    if not all(np.array_equal(one, other) for one, other in zip(arrays, copies, strict=True)):
        raise subject.failure("it changes what it is given", "that it only reads it", "work on copies")


def _scored(subject: Subject, given: Scene, policy: Policy | None = None) -> Float[np.ndarray, " p"]:
    """Score the candidates.

    Raises:
        CheckFailed: the scores are not one finite number for each candidate.
    """
    chooser: Policy = subject.built() if policy is None else policy
    try:
        return chooser.checked_scores(*given)
    except UserError as error:
        raise subject.failure(
            str(error), "one finite number for each candidate", "return an array of the length of the candidates"
        ) from error
