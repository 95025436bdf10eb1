"""A split of the data set in memory and on disk: stacked clouds with what they are."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from safetensors import SafetensorError, safe_open
from scipy.spatial import cKDTree
from torch import Tensor

from pcsr.data.sample import Sample
from pcsr.errors import UserError
from pcsr.files import save_tensors
from pcsr.geometry.frames import UnitSphere


@dataclass(frozen=True)
class Split:
    """All objects of one split. Clouds are in the frame in which the truth fills the unit sphere."""

    names: list[str]
    groups: list[str]
    truth: Float[Tensor, "k g 3"]
    points: Float[Tensor, "k n 3"]
    touches: Float[Tensor, "k a m 3"]
    spheres: list[UnitSphere]
    """For each object, how its own frame became this one."""
    about: dict[str, Any]
    """Fingerprint, counts, coverage, and the objects left out with the reasons."""

    def __len__(self) -> int:
        return len(self.names)

    @classmethod
    def of(cls, samples: Sequence[Sample], about: dict[str, Any]) -> "Split":
        """Stack samples."""
        return cls(
            names=[s.name for s in samples],
            groups=[s.group for s in samples],
            truth=torch.from_numpy(np.stack([s.truth for s in samples])),
            points=torch.from_numpy(np.stack([s.points for s in samples])),
            touches=torch.from_numpy(np.stack([s.touches for s in samples])),
            spheres=[s.sphere for s in samples],
            about=about,
        )

    def spread(self, count: int) -> "Split":
        """`count` objects, evenly spread over the split, so that every group stays in."""
        count = min(count, len(self))
        kept = [i * len(self) // count for i in range(count)]
        return Split(
            names=[self.names[i] for i in kept],
            groups=[self.groups[i] for i in kept],
            truth=self.truth[kept],
            points=self.points[kept],
            touches=self.touches[kept],
            spheres=[self.spheres[i] for i in kept],
            about=self.about,
        )

    def coverage(self, touches: int) -> float:
        """Mean share of the truth's points that the first `touches` touches cover.

        A point is covered if a touched point lies within twice the usual distance of touched points.
        """
        if touches == 0 or self.touches.shape[1] == 0:
            return 0.0
        shares = []
        for truth, felt in zip(self.truth.numpy(), self.touches[:, :touches].numpy(), strict=True):
            spacing = np.median([cKDTree(touch).query(touch, k=2)[0][:, 1].mean() for touch in felt])
            distance = cKDTree(felt.reshape(-1, 3)).query(truth)[0]
            shares.append(float((distance < 2 * spacing).mean()))
        return float(np.mean(shares))

    def save(self, path: Path) -> None:
        """Write the split whole, or not at all."""
        card = {
            "names": self.names,
            "groups": self.groups,
            "spheres": [[*map(float, s.centre), float(s.radius)] for s in self.spheres],
            "about": self.about,
        }
        tensors = {"truth": self.truth, "points": self.points, "touches": self.touches}
        save_tensors(path, tensors, {"pcsr": json.dumps(card)})

    @classmethod
    def load(cls, path: Path) -> "Split":
        """Read a split.

        Raises:
            UserError: the file is damaged or not a split.
        """
        try:
            with safe_open(path, "pt") as file:
                card = json.loads(file.metadata()["pcsr"])
                tensors = {name: file.get_tensor(name) for name in ("truth", "points", "touches")}
        except (SafetensorError, KeyError, TypeError, ValueError) as error:
            raise UserError(
                f"{path} is not a split of pcsr data ({error}): delete it to have it built again"
            ) from error
        spheres = [UnitSphere(np.array(s[:3]), s[3]) for s in card["spheres"]]
        return cls(card["names"], card["groups"], spheres=spheres, about=card["about"], **tensors)
