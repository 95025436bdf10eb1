"""Touches of a batch of clouds, in one record."""

from dataclasses import dataclass

import torch
from jaxtyping import Bool, Float
from torch import Tensor

from pcsr.tensors import TouchFeatures, TouchMask, TouchPoints


@dataclass(frozen=True)
class TouchBatch:
    """Touches of b clouds: up to a touches of each cloud, and m points of each touch.

    Rows may hold different numbers of touches, and a may be 0. The entries of `points` and `features` are arbitrary
    where `mask` is False.

    Examples:
        >>> touches = pcsr.TouchBatch(torch.ones(2, 3, 5, 3), torch.ones(2, 3, 5, 8), torch.ones(2, 3).bool())
        >>> touches.flat.shape, touches.flat_points.shape, touches.flat_padding.shape
        (torch.Size([2, 15, 8]), torch.Size([2, 15, 3]), torch.Size([2, 15]))
    """

    points: TouchPoints
    """Coordinates of the touched points, (b a m 3), in the frame of the clouds."""
    features: TouchFeatures
    """Features of the touched points, (b a m c). Without a touch encoder they are the coordinates."""
    mask: TouchMask
    """True where a touch is present, (b a)."""

    @classmethod
    def of(cls, points: TouchPoints, mask: TouchMask | None = None) -> "TouchBatch":
        """Create a batch of touches that are not encoded: their features are their coordinates.

        Args:
            points: (b a m 3).
            mask: (b a); by default every touch is present.

        Examples:
            >>> touches = pcsr.TouchBatch.of(torch.rand(2, 3, 5, 3))
            >>> touches.mask.all().item(), touches.features is touches.points
            (True, True)
        """
        present = torch.ones(points.shape[:2], dtype=torch.bool, device=points.device) if mask is None else mask
        return cls(points, points, present)

    @property
    def flat(self) -> Float[Tensor, "b am c"]:
        """Features of all touched points of a row in one axis."""
        return self.features.flatten(1, 2)

    @property
    def flat_points(self) -> Float[Tensor, "b am 3"]:
        """Coordinates of all touched points of a row, in the order of `flat`."""
        return self.points.flatten(1, 2)

    @property
    def flat_padding(self) -> Bool[Tensor, "b am"]:
        """True where `flat` belongs to a missing touch: the key padding mask of an attention layer."""
        return ~self.mask.repeat_interleave(self.points.shape[2], dim=1)
