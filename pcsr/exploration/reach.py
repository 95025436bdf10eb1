"""Whether a fingertip can stand at a candidate, judged by the points of the surface."""

from collections import Counter
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pcsr.contracts import TouchCandidates
from pcsr.exploration.contact import ContactModel, ExpectedContact

ASIDE = 3.0
"""A candidate is refused if the finger meets something this far above its point, in mm: that is another surface."""


@dataclass(frozen=True)
class Reachable:
    """Candidates at which a fingertip can stand."""

    rows: Int[np.ndarray, " k"]
    """Their indices."""
    contacts: list[ExpectedContact]
    """Their expected contacts."""
    refused: Counter[str]
    """Number of refused candidates by reason."""


def reachable(candidates: TouchCandidates, model: ContactModel) -> Reachable:
    """Find the candidates whose housing passes, and whose expected contact is large enough.

    Args:
        candidates: poses of the fingertip.
        model: points of the surface, known and guessed, in mm.
    """
    rows: list[int] = []
    contacts: list[ExpectedContact] = []
    refused: Counter[str] = Counter()
    tip = candidates.fingertip
    for row, (point, frame, press) in enumerate(
        zip(candidates.points, candidates.frames, candidates.presses.tolist(), strict=True)
    ):
        contact = model.press(point, frame, press, tip)
        if contact is None or contact.top > ASIDE:
            refused["behind other points of the cloud"] += 1
        elif _beside(model.points, point, frame, tip.gel, tip.housing) > contact.top - press + tip.protrusion:
            refused["without room for the housing"] += 1
        elif contact.area < tip.least_area:
            refused[f"with less contact than {tip.least_area:.3g} mm²"] += 1
        else:
            rows.append(row)
            contacts.append(contact)
    return Reachable(np.array(rows, np.int64), contacts, refused)


def _beside(
    points: Float[np.ndarray, "n 3"],
    point: Float[np.ndarray, "3"],
    frame: Float[np.ndarray, "3 3"],
    gel: tuple[float, float],
    housing: tuple[float, float],
) -> float:
    """Return the height of the highest point under the housing beside the gel, above the candidate's point."""
    local = (points - point) @ frame
    across = np.abs(local[:, :2])
    under = (across < np.array(housing) / 2).all(1) & ~(across < np.array(gel) / 2).all(1)
    return float(local[under, 2].max(initial=-np.inf))
