"""The parts in a row: one network, whatever they are (TAPSR, Sec. 3.1, Fig. 1)."""

from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcsr.contracts import Backbone, Encoder, Fusion, TouchBatch, Upsampler
from pcsr.errors import UserError
from pcsr.geometry.anchoring import even_subset
from pcsr.tensors import Dense, Features, Points, TouchFeatures, TouchMask, TouchPoints

Felt = tuple[TouchPoints, TouchMask]
"""Touches, and which of them are there."""


class Network(nn.Module):
    """Q = f(P, T): a sparse cloud and any number of touches to a cloud of `rate` times as many points."""

    def __init__(
        self,
        encoder: Encoder,
        touch_encoder: Encoder | None,
        fusion: Fusion,
        backbone: Backbone,
        upsampler: Upsampler,
    ) -> None:
        super().__init__()
        self.encoder = encoder
        self.touch_encoder = touch_encoder
        self.fusion = fusion
        self.backbone = backbone
        self.upsampler = upsampler

    def forward(
        self,
        points: Points,
        rate: int,
        touches: TouchPoints | None = None,
        mask: TouchMask | None = None,
    ) -> Dense:
        """Upsample a batch of clouds in the unit sphere.

        Args:
            points: (b n 3).
            rate: output points for each input point.
            touches: (b a m 3), in the frame of `points`; none by default.
            mask: (b a), False where a row holds fewer than `a` touches; all True by default.

        Returns:
            (b rate·n 3), in the same frame. In training there may be more: touched points, and what was made of
            them, are not thinned.
        """
        max_rate_per_pass = self.upsampler.max_rate_per_pass
        first = (
            1
            if self.training or max_rate_per_pass is None or rate <= max_rate_per_pass
            else _first(rate, max_rate_per_pass)
        )
        if first == 1:
            return self.stages(points, rate, touches, mask)[-1]
        cloud = self.stages(points, first, touches, mask)[-1]
        # The touches are in that cloud already; once more they take the place of what is made around them.
        dense = self._made(cloud, rate // first, None, None)[-1]
        return _thin(dense, count=rate * points.shape[1], felt=self._anchors(touches, mask))

    def stages(
        self,
        points: Points,
        rate: int,
        touches: TouchPoints | None = None,
        mask: TouchMask | None = None,
    ) -> list[Dense]:
        """As `forward`, in one pass, with the clouds on the way: the coarsest first, the result last."""
        *coarse, dense = self._made(points, rate, touches, mask)
        finish = _joined if self.training else partial(_thin, count=rate * points.shape[1])
        return [*coarse, finish(dense, felt=self._anchors(touches, mask))]

    def candidates(
        self,
        points: Points,
        rate: int,
        touches: TouchPoints | None = None,
        mask: TouchMask | None = None,
    ) -> Float[Tensor, "b more 3"]:
        """All that is made of the points before the farthest are kept, touched points among them where they count."""
        return _joined(self._made(points, rate, touches, mask)[-1], felt=self._anchors(touches, mask))

    def _anchors(self, touches: TouchPoints | None, mask: TouchMask | None) -> Felt | None:
        """The touches whose points are part of the result."""
        if touches is None or not self.fusion.keeps_touched_points:
            return None
        return touches, _all(touches) if mask is None else mask

    def _made(
        self, points: Points, rate: int, touches: TouchPoints | None, mask: TouchMask | None
    ) -> list[Float[Tensor, "b _ 3"]]:
        """What the upsampler makes; in training without its surplus."""
        start = self.upsampler.prepare(points, rate)
        cloud, features = self.refine(start, touches, mask)
        left = rate * points.shape[1] // start.shape[1]
        *coarse, dense = self.upsampler.stages(cloud, features, left)
        return [*coarse, _some(dense, left * cloud.shape[1]) if self.training else dense]

    def refine(
        self, points: Points, touches: TouchPoints | None = None, mask: TouchMask | None = None
    ) -> tuple[Float[Tensor, "b joined 3"], Float[Tensor, "b joined c"]]:
        """What the upsampler is handed: the cloud, to which the touches may have been joined, and its features."""
        if touches is not None and mask is None:
            mask = _all(touches)
        cloud = points if touches is None or mask is None else self.fusion.join(points, touches, mask)
        features = self.encoder(cloud)
        if touches is not None and mask is not None and self.fusion.uses_touch_features:
            features = fuse(self.fusion, self.touch_encoder, cloud, features, touches, mask)
        return cloud, self.backbone(cloud, features)

    @property
    def parameter_count(self) -> int:
        """Number of weights."""
        return sum(p.numel() for p in self.parameters())


def _all(touches: TouchPoints) -> TouchMask:
    """No touch is missing."""
    return torch.ones(touches.shape[:2], dtype=torch.bool, device=touches.device)


def fuse(
    fusion: Fusion,
    touch_encoder: Encoder | None,
    points: Points,
    features: Features,
    touches: TouchPoints,
    mask: TouchMask,
) -> Features:
    """Encode the touches and fold them into the features; rows without any touch keep theirs as they are.

    So a fusion never meets a row without touches, where attention would divide zero by zero, and zero touches
    give exactly the visual features, bit for bit.
    """
    touched = mask.any(1)
    if not torch.compiler.is_exporting():
        if not touched.any():
            return features
        if not touched.all():
            fused = fuse(fusion, touch_encoder, points[touched], features[touched], touches[touched], mask[touched])
            return features.masked_scatter(touched[:, None, None], fused)
    heard = TouchBatch(touches, encode(touch_encoder, touches), mask)
    result: Features = fusion(points, features, heard)
    return result


def encode(touch_encoder: Encoder | None, touches: TouchPoints) -> TouchFeatures:
    """Features of each touched point; without an encoder the coordinates themselves."""
    if touch_encoder is None:
        return touches
    features: Tensor = touch_encoder(touches.flatten(0, 1))
    return features.view(*touches.shape[:2], *features.shape[1:])


def _first(rate: int, max_rate_per_pass: int) -> int:
    """The rate of the first of two passes: near the root, neither being too much. 1: it can't be shared."""
    divisors = [d for d in range(1, rate + 1) if rate % d == 0]
    return min(divisors, key=lambda d: (max(d, rate // d) > max_rate_per_pass, abs(d - rate**0.5), -d))


def _some(dense: Dense, count: int) -> Float[Tensor, "b some 3"]:
    """In training: as many as are wanted of an upsampler's surplus, any of them.

    Which are the farthest from each other has no gradient, and takes longer than the network. But that each may be
    missing must be felt, or the network is content where one of two that lie together would do.
    """
    if dense.shape[1] <= count:
        return dense
    kept = torch.randperm(dense.shape[1], generator=torch.Generator().manual_seed(0))[:count]
    return dense[:, kept.to(dense.device)]


def _joined(dense: Dense, *, felt: Felt | None) -> Float[Tensor, "b more 3"]:
    """The dense cloud and all touched points; in the place of a missing touch some of the cloud's points again."""
    if felt is None:
        return dense
    touches, mask = felt
    m = touches.shape[2]
    again = dense.detach()[:, torch.arange(m, device=dense.device) % dense.shape[1]]
    known = torch.where(mask[:, :, None, None], touches, again.unsqueeze(1))
    return torch.cat([dense, known.flatten(1, 2)], dim=1)


def _thin(dense: Dense, *, count: int, felt: Felt | None) -> Float[Tensor, "b kept 3"]:
    """Keep the `count` farthest points, touched ones among them if there are any.

    Some upsamplers give too many, and any does for a cloud with touches in it.

    Raises:
        UserError: the network is being exported.
    """
    if dense.shape[1] == count and felt is None:
        return dense
    if torch.compiler.is_exporting():
        cause = "its upsampler makes" if felt is None else "with touches the network has"
        remedy = "use an upsampler that makes as many as are asked for, such as 'shuffle'"
        raise UserError(
            f"{cause} more points than are asked for and keeps those that are farthest apart, a step that ONNX does "
            f"not have: {remedy if felt is None else 'export it without touches'}"
        )
    rows = []
    for i, row in enumerate(dense):
        known = row[:0] if felt is None else felt[0][i, felt[1][i]].flatten(0, 1)
        both = torch.cat([known, row])
        if not len(known) and len(row) == count:  # no touch: as it would be alone
            rows.append(row)
            continue
        rows.append(both[torch.from_numpy(even_subset(both.detach().cpu().numpy(), count, len(known))).to(row.device)])
    return torch.stack(rows)
