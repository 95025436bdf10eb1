"""Expected error of an upsampled cloud, and what a touch is expected to take off it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from pcsr.contracts import TouchCandidates
from pcsr.exploration.contact import ContactModel, ExpectedContact
from pcsr.exploration.surface import KnownSurface

SMOOTH, CURVED = 0.068, 0.36
"""What a touch takes off per squared distance of the surface from the nearest known point, on a plane, and per
variation of the normals beside it. Least squares on training parts: `python benchmarks/fit_gain.py`."""
ERROR_SMOOTH, ERROR_CURVED = 0.167, 0.165
"""The same of the whole error of the upsampled cloud, from the same command."""
SEEN, HIDDEN = 1.5, 3.0
"""Distances from the nearest known point, in spacings there. Up to the first an upsampler completes the surface; from
the second on nothing does, and the error is the whole squared distance. Between them it rises linearly."""
NEIGHBOURS = 4
"""Known points over which the variation of normals is averaged."""


@dataclass(frozen=True)
class Density:
    """Error density at points of the surface: the error in mm² of surface of which they are a sample."""

    squared: Float[np.ndarray, " p"]
    """Squared distance to the nearest known point, in mm²."""
    share: Float[np.ndarray, " p"]
    """Share of the squared distance that counts, where the cloud is known around the point."""
    spacing: Float[np.ndarray, " p"]
    """Spacing of the known points around it, in mm."""

    @classmethod
    def at(
        cls, points: Float[np.ndarray, "p 3"], known: KnownSurface, smooth: float = SMOOTH, curved: float = CURVED
    ) -> "Density":
        """Compute the density at points of the surface, with the coefficients of the gain or of the whole error."""
        distance, _ = known.tree.query(points)
        _, rows = known.thinned.query(points, k=NEIGHBOURS)
        share = smooth + curved * known.variation[rows].mean(1)
        return cls(distance**2, np.minimum(share, 1.0), known.spacing[rows[:, 0]])

    def seen(self) -> Float[np.ndarray, " p"]:
        """Return the density of surface that the cloud shows around the points, in mm²."""
        density: Float[np.ndarray, " p"] = self.squared * self.share * (1 - self._hidden(self.squared))
        return density

    def hidden(self, squared: Float[np.ndarray, " p"] | None = None) -> Float[np.ndarray, " p"]:
        """Return the density of hidden surface in mm², at given squared distances or those to the known points."""
        squared = self.squared if squared is None else squared
        density: Float[np.ndarray, " p"] = squared * self._hidden(squared)
        return density

    def _hidden(self, squared: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        hidden: Float[np.ndarray, " p"] = np.clip((np.sqrt(squared) / self.spacing - SEEN) / (HIDDEN - SEEN), 0, 1)
        return hidden


@dataclass(frozen=True)
class Expectation:
    """Expected gains of touches, given a cloud, earlier touches and points drawn evenly from the surface."""

    known: KnownSurface
    model: ContactModel
    surface: Float[np.ndarray, "p 3"]
    density: Density
    """At the points of the surface."""
    area: float
    """Area of the whole surface in mm², hidden parts included."""

    @classmethod
    def of(
        cls, surface: Float[np.ndarray, "p 3"], cloud: Float[np.ndarray, "n 3"], touched: Float[np.ndarray, "f 3"]
    ) -> "Expectation":
        """Prepare the expectation. All lengths are in mm."""
        known = KnownSurface.of(cloud, touched)
        density = Density.at(surface, known)
        seen = float((np.sqrt(density.squared) < HIDDEN * density.spacing).mean())
        model = ContactModel.of(np.concatenate([known.points, surface]))
        return cls(known, model, surface, density, known.area / max(seen, 0.1))

    def contacts(self, candidates: TouchCandidates) -> list[ExpectedContact | None]:
        """Return the expected contact of each candidate."""
        each = zip(candidates.points, candidates.frames, candidates.presses, strict=True)
        return [self.model.press(point, frame, float(press), candidates.fingertip) for point, frame, press in each]

    def gain(self, contact: ExpectedContact | None) -> float:
        """Return what a touch is expected to take off the Chamfer distance, in mm².

        Where the cloud shows the surface, the error vanishes in the contact. On a hidden side it falls around the
        contact too, where the touched points are nearer than all known ones.
        """
        if contact is None or len(contact.points) == 0:
            return 0.0
        seen = float((contact.probability * Density.at(contact.points, self.known).seen()).sum()) * contact.cell
        gain = seen / self.area
        likely = contact.probability > 0.5
        if likely.any():
            squared = KDTree(contact.points[likely]).query(self.surface)[0] ** 2
            after = self.density.hidden(np.minimum(squared, self.density.squared))
            gain += float((self.density.hidden() - after).mean())
        return gain

    def error(self) -> float:
        """Return the expected Chamfer distance before the touch, in mm²."""
        whole = Density.at(self.surface, self.known, ERROR_SMOOTH, ERROR_CURVED)
        return float((whole.seen() + whole.hidden()).mean())
