"""The upsampling network: encoder, fusion, backbone and upsampler in a row (TAPSR, Sec. 3.1, Fig. 1)."""

from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcsr.contracts import Backbone, Encoder, Fusion, TouchBatch, Upsampler
from pcsr.errors import UserError
from pcsr.geometry.anchoring import even_subset
from pcsr.grafting.fuse import fuse
from pcsr.tensors import Dense, Points


class Network(nn.Module):
    """Q = f(P, T): maps a sparse cloud and any number of touches to a cloud of `rate` times as many points."""

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

    def forward(self, points: Points, rate: int, touches: TouchBatch | None = None) -> Dense:
        """Upsample a batch of clouds in the unit sphere.

        Args:
            points: (b n 3).
            rate: output points for each input point.
            touches: touches in the frame of `points`; none by default.

        Returns:
            (b rate·n 3), in the same frame. In training there may be more points: touched points, and points generated
            from them, are not thinned out.
        """
        limit = self.upsampler.max_rate_per_pass
        first = 1 if self.training or limit is None or rate <= limit else _first_rate(rate, limit)
        if first == 1:
            return self.stages(points, rate, touches)[-1]
        cloud = self.stages(points, first, touches)[-1]
        # `cloud` contains the touched points; in the result they replace again what is generated around them.
        dense = self._generate(cloud, rate // first, None)[-1]
        return _thin(dense, count=rate * points.shape[1], touches=self._kept(touches))

    def stages(self, points: Points, rate: int, touches: TouchBatch | None = None) -> list[Dense]:
        """Upsample in one pass, and return the intermediate clouds too: the coarsest first, the result last."""
        *coarse, dense = self._generate(points, rate, touches)
        finish = _with_touched if self.training else partial(_thin, count=rate * points.shape[1])
        return [*coarse, finish(dense, touches=self._kept(touches))]

    def candidates(
        self, points: Points, rate: int, touches: TouchBatch | None = None
    ) -> tuple[Float[Tensor, "b candidates 3"], Float[Tensor, "b candidates"] | None]:
        """Generate points without thinning them out, and predict their distances from the surface.

        There are at least `rate` for each input point. They include the touched points, last and with an error of 0, if
        the fusion keeps those.

        Returns:
            The points, and their predicted errors in the unit of `points`; None if the upsampler predicts none.
        """
        start = self.upsampler.prepare(points, rate)
        cloud, features = self.refine(start, touches)
        dense, errors = self.upsampler.with_errors(cloud, features, rate * points.shape[1] // start.shape[1])
        both = _with_touched(dense, touches=self._kept(touches))
        if errors is not None:
            errors = nn.functional.pad(errors, (0, both.shape[1] - dense.shape[1]))
        return both, errors

    def refine(
        self, points: Points, touches: TouchBatch | None = None
    ) -> tuple[Float[Tensor, "b joined 3"], Float[Tensor, "b joined c"]]:
        """Compute the upsampler's input: the cloud, to which the fusion may have joined touches, and its features."""
        cloud = points if touches is None else self.fusion.join(points, touches)
        features = self.encoder(cloud)
        if touches is not None and self.fusion.uses_touch_features:
            features = fuse(self.fusion, self.touch_encoder, cloud, features, touches)
        return cloud, self.backbone(cloud, features)

    @property
    def parameter_count(self) -> int:
        """Number of weights."""
        return sum(p.numel() for p in self.parameters())

    def _kept(self, touches: TouchBatch | None) -> TouchBatch | None:
        """Return the touches whose points are part of the dense cloud; `None` if the fusion keeps none."""
        return touches if self.fusion.keeps_touched_points else None

    def _generate(self, points: Points, rate: int, touches: TouchBatch | None) -> list[Float[Tensor, "b _ 3"]]:
        """Return the upsampler's clouds without touched points. In training the last has `rate`·n points."""
        start = self.upsampler.prepare(points, rate)
        cloud, features = self.refine(start, touches)
        left = rate * points.shape[1] // start.shape[1]
        *coarse, dense = self.upsampler.stages(cloud, features, left)
        return [*coarse, _random_subset(dense, left * cloud.shape[1]) if self.training else dense]


def _first_rate(rate: int, limit: int) -> int:
    """Return the first of two factors of `rate`, at most `limit` and as equal as possible; 1 if there are none."""
    divisors = [d for d in range(1, rate + 1) if rate % d == 0]
    return min(divisors, key=lambda d: (max(d, rate // d) > limit, abs(d - rate**0.5), -d))


def _random_subset(dense: Dense, count: int) -> Float[Tensor, "b kept 3"]:
    """Return at most `count` random points of each row.

    Dropping surplus points at random in training forces the network to spread them; otherwise it generates duplicates.
    Keeping the points that are farthest apart instead has no gradient and takes longer than the network itself.
    """
    if dense.shape[1] <= count:
        return dense
    kept = torch.randperm(dense.shape[1], generator=torch.Generator().manual_seed(0))[:count]
    return dense[:, kept.to(dense.device)]


def _with_touched(dense: Dense, *, touches: TouchBatch | None) -> Float[Tensor, "b more 3"]:
    """Append all touched points to the dense cloud; a missing touch is filled with copies of the cloud's points."""
    if touches is None:
        return dense
    copied = dense.detach()[:, torch.arange(touches.points.shape[2], device=dense.device) % dense.shape[1]]
    touched = torch.where(touches.mask[:, :, None, None], touches.points, copied.unsqueeze(1))
    return torch.cat([dense, touched.flatten(1, 2)], dim=1)


def _thin(dense: Dense, *, count: int, touches: TouchBatch | None) -> Float[Tensor, "b kept 3"]:
    """Keep the `count` points of each row that are farthest apart, touched points first.

    Raises:
        UserError: the network is being exported.
    """
    if dense.shape[1] == count and touches is None:
        return dense
    if torch.compiler.is_exporting():
        cause = "its upsampler makes" if touches is None else "with touches the network has"
        remedy = "use an upsampler that makes as many as are asked for, such as 'shuffle'"
        raise UserError(
            f"{cause} more points than are asked for and keeps those that are farthest apart, a step that ONNX does "
            f"not have: {remedy if touches is None else 'export it without touches'}"
        )
    rows = []
    for i, row in enumerate(dense):
        touched = row[:0] if touches is None else touches.points[i, touches.mask[i]].flatten(0, 1)
        both = torch.cat([touched, row])
        if not len(touched) and len(row) == count:  # rows without touches are independent of the others
            rows.append(row)
            continue
        kept = even_subset(both.detach().cpu().numpy(), count, len(touched))
        rows.append(both[torch.from_numpy(kept).to(row.device)])
    return torch.stack(rows)
