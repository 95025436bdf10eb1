"""Local reference frames (LRF) and rotation-invariant edge features.

A neighbourhood is described by lengths and angles alone, as in point pair features (Drost et al., "Model Globally,
Match Locally", CVPR 2010, Eq. 1), here with the normal of the neighbourhood and in units of the spacing of its points.
A network that takes these features, and predicts in the same frame, is equivariant to rotation, translation and scale
by construction.
"""

import math
from collections.abc import MutableMapping
from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.utils.weak import WeakIdKeyDictionary

from pcsr.geometry.neighbours import gather, knn
from pcsr.tensors import Neighbours, Points
from pcsr_plugins.layers.spacing import mean_length

SCALARS = 8
"""Features of an edge."""


@dataclass(frozen=True)
class LocalFrames:
    """Local reference frame of each point. Nothing here has a gradient."""

    index: Neighbours
    """The nearest other points, nearest first."""
    offsets: Float[Tensor, "b n k 3"]
    """Offsets to them, in units of `unit`."""
    unit: Float[Tensor, "b n 1"]
    """The spacing: mean distance to the nearest few."""
    normal: Float[Tensor, "b n 3"]
    """Of the plane that fits the neighbourhood best, on the side on which most of it lies."""
    rough: Float[Tensor, "b n 1"]
    """Root mean square of the neighbours' heights over that plane, in units of `unit`: 0 where all is flat."""

    @classmethod
    def of(cls, points: Points, neighbours: int) -> "LocalFrames":
        """Of each point and its nearest other ones; fewer where there are fewer.

        Encoder, backbone and upsampler ask for the frames of the same tensor: they are fitted once, and kept as long as
        the tensor exists.

        Raises:
            UserError: there is no other point.
        """
        if torch.compiler.is_exporting():
            return cls._fit(points, neighbours)
        version = None if points.is_inference() else points._version  # changes when the points do
        key = neighbours, version, torch.is_inference_mode_enabled()  # no gradient passes what inference mode made
        fitted = _FITTED.setdefault(points, {})
        if key not in fitted:
            fitted[key] = cls._fit(points, neighbours)
        return fitted[key]

    @classmethod
    def _fit(cls, points: Points, neighbours: int) -> "LocalFrames":
        with torch.no_grad():
            index = knn(points, points, min(neighbours + 1, max(2, points.shape[1])))[..., 1:]
            offsets = gather(points, index) - points.unsqueeze(2)
            unit = mean_length(offsets)
            offsets = offsets / unit.unsqueeze(2)
            normal = plane(offsets)
            height = (offsets * normal.unsqueeze(2)).sum(-1)
            side = torch.where(height.sum(-1, keepdim=True) < 0, -1.0, 1.0)
            rough = height.square().mean(-1, keepdim=True).sqrt()
            return cls(index, offsets, unit, normal * side, rough)

    def around(self, spokes: int) -> Int[Tensor, "b n s"]:
        """Neighbours in all directions of the tangent plane: the nearest in each of `spokes` equal sectors.

        Directions across gaps are thus covered, whose neighbours are not among the nearest of all. Height counts
        double, since a point high above the plane is on another sheet of the surface. Sectors begin at the nearest
        neighbour's direction. Empty sectors fall back to the nearest neighbours.

        Returns:
            Columns of `index`.
        """
        spokes = min(spokes, self.index.shape[2])
        height = (self.offsets * self.normal.unsqueeze(2)).sum(-1)
        flat = self.offsets - height.unsqueeze(-1) * self.normal.unsqueeze(2)
        first = flat[:, :, :1]
        turned = torch.cross(self.normal.unsqueeze(2), first, dim=-1)
        angle = torch.atan2((flat * turned).sum(-1), (flat * first).sum(-1))
        sector = torch.round(angle * spokes / (2 * math.pi)).long() % spokes  # (b n k)
        cost = self.offsets.norm(dim=-1) + 2 * height.abs()
        within = sector.unsqueeze(2) == torch.arange(spokes, device=sector.device)[:, None]  # (b n s k)
        least, column = torch.where(within, cost.unsqueeze(2), math.inf).min(-1)
        empty = least.isinf()
        return torch.where(empty, (empty.cumsum(-1) - 1).clamp_min(0), column)

    @cached_property
    def edges(self) -> Float[Tensor, "b n k 8"]:
        """Features of each edge: length, heights over both planes, their angle, and how both ends differ."""
        neighbour_normals = gather(self.normal, self.index)
        middle = self.offsets.mean(2, keepdim=True)
        return torch.stack(
            [
                self.offsets.norm(dim=-1),
                (self.offsets * self.normal.unsqueeze(2)).sum(-1),
                (self.offsets * neighbour_normals).sum(-1),
                (neighbour_normals * self.normal.unsqueeze(2)).sum(-1),
                (gather(self.unit, self.index) / self.unit.unsqueeze(2)).squeeze(-1).log().clamp(-3, 3),
                gather(self.rough, self.index).squeeze(-1) - self.rough,
                (self.offsets * middle).sum(-1),
                (self.offsets * gather(middle.squeeze(2), self.index)).sum(-1),
            ],
            dim=-1,
        )


_FITTED: MutableMapping[Tensor, dict[tuple[int, int | None, bool], LocalFrames]] = WeakIdKeyDictionary()
"""Frames of the clouds that exist, by the number of neighbours, version of the tensor, and inference mode."""


def plane(offsets: Float[Tensor, "b n k 3"]) -> Float[Tensor, "b n 3"]:
    """The normal of the plane through a point that fits its neighbours best, of either sign."""
    spread = offsets - offsets.mean(2, keepdim=True)
    # In double precision: of a flat neighbourhood the least eigenvalue is 0, and its direction must not be noise.
    spread = spread.double()
    normal: Tensor = torch.linalg.eigh(spread.mT @ spread).eigenvectors[..., 0]
    return normal.to(offsets.dtype)
