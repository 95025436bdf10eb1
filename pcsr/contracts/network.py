"""The parts of a network.

b is the number of clouds in a batch, n of points in a cloud, c of channels, a of touches of a cloud, m of points of a
touch. All coordinates are in the frame in which the sparse cloud fills the unit sphere.
"""

from typing import ClassVar

from jaxtyping import Float
from torch import Tensor, nn

from pcsr.contracts.part import Part
from pcsr.contracts.touch_batch import TouchBatch
from pcsr.tensors import Dense, Features, Points


class Encoder(nn.Module, Part):
    """Computes features of each point from the coordinates of a cloud.

    A network has an encoder for the cloud and, where its fusion uses touch features, another one for the touches. The
    touch encoder is called with each touch as a cloud of its own.

    Examples:
        >>> class Scaled(pcsr.Encoder):
        ...     def __init__(self, widths: pcsr.Widths, *, scale: float = 2.0) -> None:
        ...         super().__init__()
        ...         self.channels, self.scale = 3, scale
        ...
        ...     def forward(self, points):
        ...         return self.scale * points
        >>> Scaled(pcsr.Widths())(torch.ones(1, 1, 3))
        tensor([[[2., 2., 2.]]])
    """

    channels: int
    """Number of output channels; set in the constructor."""

    def forward(self, points: Points) -> Features:
        """Encode a batch of clouds.

        Args:
            points: (b n 3).

        Returns:
            (b n channels), in the order of `points`.
        """
        raise NotImplementedError


class Fusion(nn.Module, Part):
    """Combines touches with the visual features.

    The host calls `join` before the encoder and `forward` after it. Rows without touches keep their visual features
    and never reach `forward`.

    Examples:
        >>> class Mean(pcsr.Fusion):
        ...     def __init__(self, widths: pcsr.Widths) -> None:
        ...         super().__init__()
        ...
        ...     def forward(self, points, features, touches):
        ...         return features + touches.features.mean((1, 2))[:, None]
        >>> touches = pcsr.TouchBatch(torch.ones(1, 2, 3, 3), torch.ones(1, 2, 3, 4), torch.ones(1, 2).bool())
        >>> Mean(pcsr.Widths(visual=4, touch=4))(torch.ones(1, 5, 3), torch.zeros(1, 5, 4), touches).shape
        torch.Size([1, 5, 4])
    """

    uses_touch_features: ClassVar[bool] = True
    """Whether the fusion uses touch features. If False, the network has no touch encoder, and `forward` is not
    called."""
    keeps_touched_points: bool = False
    """Whether touched points become part of the dense cloud. If True, the host inserts them after the upsampler, and
    drops generated points that lie closer to them than the cloud's spacing. An instance may differ from its class."""

    def forward(self, points: Points, features: Features, touches: TouchBatch) -> Features:
        """Fuse touches with visual features.

        Args:
            points: (b n 3); what `join` returned.
            features: visual features, (b n c).
            touches: touches with their features, at least one in each row.

        Returns:
            Fused features, (b n c), in the order of `points`.
        """
        raise NotImplementedError

    def join(self, points: Points, touches: TouchBatch) -> Float[Tensor, "b joined 3"]:
        """Add touched points to the cloud before it is encoded. By default the cloud stays as it is.

        Args:
            points: (b n 3).
            touches: touches without features. A row may have no touch; its cloud must then stay as it is.

        Returns:
            (b joined 3): the points of the cloud and those added.

        Raises:
            UserError: the rows would have different numbers of points; the message names the part.
        """
        return points


class Backbone(nn.Module, Part):
    """Refines the fused features, given the coordinates of their points.

    Examples:
        >>> class Layer(pcsr.Backbone):
        ...     def __init__(self, widths: pcsr.Widths, *, channels: int = 8) -> None:
        ...         super().__init__()
        ...         self.channels = channels
        ...         self.layer = torch.nn.Linear(widths.visual, channels)
        ...
        ...     def forward(self, points, features):
        ...         return self.layer(features)
        >>> Layer(pcsr.Widths(visual=4))(torch.ones(1, 5, 3), torch.ones(1, 5, 4)).shape
        torch.Size([1, 5, 8])
    """

    channels: int
    """Number of output channels; set in the constructor."""

    def forward(self, points: Points, features: Features) -> Float[Tensor, "b n refined"]:
        """Refine the features of a batch of clouds.

        Args:
            points: (b n 3).
            features: (b n c).

        Returns:
            (b n channels), in the order of `points`.
        """
        raise NotImplementedError


class Upsampler(nn.Module, Part):
    """Generates the dense cloud from refined features.

    Examples:
        >>> class Copies(pcsr.Upsampler):
        ...     def __init__(self, widths: pcsr.Widths) -> None:
        ...         super().__init__()
        ...
        ...     def forward(self, points, features, rate):
        ...         return points.repeat_interleave(rate, dim=1)
        >>> Copies(pcsr.Widths())(torch.ones(1, 5, 3), torch.ones(1, 5, 4), 2).shape
        torch.Size([1, 10, 3])
    """

    max_rate_per_pass: ClassVar[int | None] = None
    """Largest rate of a single forward pass at inference. Larger rates are reached by applying the network twice.
    None: no limit."""
    corrects_points: ClassVar[bool] = False
    """Whether the dense cloud contains a corrected copy of each input point. If True, `pcsr upsample` drops points that
    an earlier pass generated in favour of their copies."""

    def prepare(self, points: Points, rate: int) -> Dense:
        """Interpolate the sparse cloud before it is encoded. By default the cloud stays as it is.

        If this returns k·n points, features are computed on them and `forward` is called with `rate` / k. Patches are
        cut from the returned cloud, so that nothing is interpolated across their borders.

        Args:
            points: (b n 3).
            rate: of the dense cloud.

        Returns:
            (b k·n 3); at rate 1 the points themselves.
        """
        return points

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """Generate the dense cloud.

        Args:
            points: (b n 3).
            features: (b n refined), of these points.
            rate: points to generate for each point.

        Returns:
            (b rate·n 3) or more points. Of more, the host keeps those that are farthest apart, in training a random
            subset.

        Raises:
            UserError: the part was built for another rate; the message names the part.
        """
        raise NotImplementedError

    def stages(self, points: Points, features: Features, rate: int) -> list[Dense]:
        """Generate the dense cloud and return the intermediate clouds too, for objectives that use them.

        Args:
            points: (b n 3).
            features: (b n refined).
            rate: points to generate for each point.

        Returns:
            Clouds, the coarsest first; the last is the result of `forward`. By default the result alone.
        """
        return [self(points, features, rate)]

    def with_errors(
        self, points: Points, features: Features, rate: int
    ) -> tuple[Dense, Float[Tensor, "b dense"] | None]:
        """Generate the dense cloud and predict the distance of each of its points from the surface.

        `pcsr upsample` prefers points of small predicted error among those that fill a gap equally well.

        Args:
            points: (b n 3).
            features: (b n refined).
            rate: points to generate for each point.

        Returns:
            The result of `forward`, and its predicted errors in the unit of `points`, (b dense); None by default: the
            upsampler predicts none.
        """
        return self(points, features, rate), None
