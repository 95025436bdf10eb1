"""Choice of poses, one after the other, as if those before had been touched."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from pcsr.contracts import Fingertip, Policy, TouchCandidates
from pcsr.exploration.contact import ContactModel, ExpectedContact
from pcsr.exploration.guess import direction, guessed_candidates
from pcsr.exploration.reach import reachable
from pcsr.exploration.surface import KnownSurface

APART = 0.5
"""Least distance between two poses, in shorter sides of the gel."""
TOUCHED = 1.5
"""A cell of the gel this near to a touched point is touched already, in mm."""
LEAST_GAIN = 0.0005
"""A touch that is expected to take off a smaller share of the error is not proposed."""


@dataclass(frozen=True)
class NextTouch:
    """Pose at which the finger should touch next.

    Examples:
        >>> pcsr.NextTouch(np.eye(4), gain=0.5, share=0.1, contact_area=80.0, guessed=False).gain
        0.5
    """

    pose: Float[np.ndarray, "4 4"]
    """From mm in the frame of the sensor to the frame and unit of the cloud, as `Touch.poses`: its origin is where the
    centre of the unpressed face comes to rest, and the finger approaches along its -z axis."""
    gain: float | None
    """What the touch is expected to take off the Chamfer distance, in mm², after those before it; None if the policy
    does not expect any."""
    share: float | None
    """The same as a share of the expected Chamfer distance before the first of the touches."""
    contact_area: float
    """Expected contact in mm²."""
    guessed: bool
    """Whether the pose is on a side of which the cloud shows nothing, so that the surface there is a guess."""


@dataclass(frozen=True)
class NextTouches(Sequence[NextTouch]):
    """Poses to touch in this order.

    Examples:
        >>> ball = np.random.default_rng(0).normal(size=(400, 3))
        >>> ball *= 15 / np.linalg.norm(ball, axis=1, keepdims=True)
        >>> found = pcsr.next_touches(ball, count=2)
        >>> len(found), found.towards is None, found[0].gain >= found[1].gain
        (2, True, True)
    """

    touches: tuple[NextTouch, ...]
    error: float | None
    """Expected Chamfer distance before these touches, in mm²; None if the policy does not expect any. That of a far
    side is only as good as its guess."""
    towards: Float[np.ndarray, "3"] | None
    """Unit vector from the middle of the cloud towards the camera, given or estimated, behind which the far side is
    guessed; None if none is."""
    reason: str
    """Why there are fewer poses than were asked for; empty if there are not."""
    unit: float
    """Unit of the cloud in mm."""
    fingertip: Fingertip

    def __len__(self) -> int:
        return len(self.touches)

    def __getitem__(self, index: Any) -> Any:
        return self.touches[index]

    def __iter__(self) -> Iterator[NextTouch]:
        return iter(self.touches)


def choose(
    seen: Float[np.ndarray, "n 3"],
    touched: list[Float[np.ndarray, "m 3"]],
    towards: Float[np.ndarray, "3"] | None,
    all_around: bool,
    count: int,
    fingertip: Fingertip,
    policy: Policy,
    tries: int,
    rng: np.random.Generator,
    advance: Callable[[int, int], None],
) -> NextTouches:
    """Choose poses, the best first. All lengths and the poses are in mm.

    Args:
        seen: points of the cloud.
        touched: points of each touch so far.
        towards: unit vector towards the camera; None to estimate it.
        all_around: whether the cloud shows all sides, so that no far side is guessed.
        count: number of poses.
        fingertip: outline of the sensor.
        policy: chooses among the candidates that can be reached.
        tries: number of candidates.
        rng: source of randomness.
        advance: called with the number of chosen poses and `count`.

    Raises:
        UserError: the cloud has too few points.
    """
    before = np.concatenate([np.zeros((0, 3)), *touched])
    known = KnownSurface.of(seen, before)
    towards = None if all_around else direction(known, towards, fingertip)
    candidates, guessed = guessed_candidates(known, towards, tries, fingertip, rng)
    model = ContactModel.of(np.concatenate([known.points, candidates.points[guessed]]))
    possible = reachable(candidates, model)
    usable, contacts = _subset(candidates, possible.rows), possible.contacts
    total = policy.checked_error(candidates, seen, before) if len(usable) else None
    left = np.inf if total is None else total
    most = left
    free = np.array([_is_new(contact, before) for contact in contacts], bool)
    chosen: list[NextTouch] = []
    stopped = ""
    while len(chosen) < count and free.any():
        rows = np.flatnonzero(free)
        scores = policy.checked_scores(usable, seen, before)
        row = int(rows[scores[rows].argmax()])
        # No touch takes off more than is left, nor more than one that was better before it.
        gain = None if total is None else min(float(scores[row]), left, most)
        if total is not None and gain is not None and gain <= LEAST_GAIN * total:
            stopped = f"a further touch is expected to take less than {LEAST_GAIN:.2%} off the error"
            break
        if gain is not None:
            left, most = left - gain, gain
        contact = contacts[row]
        chosen.append(
            NextTouch(
                pose=_pose(usable, row, contact),
                gain=gain,
                share=min(1.0, gain / total) if gain is not None and total else None,
                contact_area=contact.area,
                guessed=bool(guessed[possible.rows[row]]),
            )
        )
        likely = contact.points[contact.probability > 0.5]
        before = np.concatenate([before, likely if len(likely) else contact.points])
        away = np.linalg.norm(usable.points - usable.points[row], axis=1)
        free &= away >= APART * min(fingertip.gel)
        advance(len(chosen), count)
    reason = "" if len(chosen) == count else stopped or _reason(possible.refused, len(usable), len(chosen))
    return NextTouches(tuple(chosen), total, towards, reason, 1.0, fingertip)


def _subset(candidates: TouchCandidates, rows: Any) -> TouchCandidates:
    return TouchCandidates(
        candidates.points[rows],
        candidates.frames[rows],
        candidates.presses[rows],
        candidates.fingertip,
        candidates.surface,
    )


def _is_new(contact: ExpectedContact, touched: Float[np.ndarray, "f 3"]) -> bool:
    """Return whether more than half of an expected contact is not touched yet."""
    if len(touched) == 0:
        return True
    near = np.isfinite(KDTree(touched).query(contact.points, distance_upper_bound=TOUCHED)[0])
    return float((contact.probability * near).sum()) < 0.5 * float(contact.probability.sum())


def _pose(candidates: TouchCandidates, row: int, contact: ExpectedContact) -> Float[np.ndarray, "4 4"]:
    """Return the pose of the sensor where its face comes to rest."""
    frame = candidates.frames[row]
    pose = np.eye(4)
    pose[:3, :3] = frame
    pose[:3, 3] = candidates.points[row] + frame[:, 2] * (contact.top - candidates.presses[row])
    return pose


def _reason(refused: Counter[str], usable: int, chosen: int) -> str:
    if usable == 0:
        total = sum(refused.values())
        why = ", ".join(f"{times} {reason}" for reason, times in refused.most_common())
        return f"none of {total} poses can be reached ({why})"
    if chosen == 0:
        return "the touches cover every surface that can be reached"
    return "all further poses that can be reached are next to one of these or are touched already"
