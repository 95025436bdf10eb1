"""The layer of a network at which touch is fused, and the layouts of points and features."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from jaxtyping import Float
from torch import Tensor

from pcsr.errors import UserError
from pcsr.recipe.graft_section import Layout, PointsLayout

Order = Literal["interleaved", "tiled"]


@dataclass(frozen=True)
class SeenPoints:
    """An argument or the output of a module that holds the points of a grafted layer."""

    module: str
    """Dotted name of the module; empty for the network itself."""
    argument: int | str | None
    """Position or keyword of the argument; None for the output."""
    layout: PointsLayout
    """Layout of the points: (b kn 3) or (b 3 kn)."""


@dataclass(frozen=True)
class InjectionPoint:
    """The layer of a network at which touch is fused, and the layouts of its points and features.

    Examples:
        >>> network = torch.nn.Sequential(torch.nn.Linear(3, 16), torch.nn.ReLU(), torch.nn.Linear(16, 3))
        >>> point = pcsr.graft(network, at="0").injection_point
        >>> point.at, point.layout, point.width, point.multiple
        ('0', 'bnc', 16, 1)
    """

    at: str
    """Dotted name of the layer."""
    layout: Layout
    """Layout of the layer's output: (b kn c), (b c kn) or (b c kn 1)."""
    width: int
    """Number of channels of the layer's output."""
    points: int | str = 0
    """The network's argument for the points: a position or a keyword."""
    points_layout: PointsLayout = "bnc"
    """Layout of the points: (b n 3) or (b 3 n)."""
    channels: int = 3
    """Number of channels of the points, of which the first three are the coordinates."""
    multiple: int = 1
    """k, the number of features of the layer for each point of the input."""
    order: Order | None = None
    """Order of the features where these belong to k copies of each point: "interleaved" (0 0 1 1 …) or "tiled"
    (0 1 … 0 1 …)."""
    seen: SeenPoints | None = None
    """The points of the layer, where the network computes k·n of them ahead of it."""
    smallest_batch: int = 1
    """Smallest number of clouds in a batch: 2 for networks that fail on one, as those do that squeeze its axis away."""


def visual_points(point: InjectionPoint, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Float[Tensor, "b n 3"]:
    """The visual points; a copy, as networks may centre theirs in place before the layer is reached."""
    cloud = _argument(point.points, args, kwargs)
    axis = channel_axis(point.points_layout)
    if not isinstance(cloud, Tensor) or cloud.dim() != 3 or cloud.shape[axis] != point.channels:
        shape = tuple(cloud.shape) if isinstance(cloud, Tensor) else type(cloud).__name__
        wanted = f"(b n {point.channels})" if axis == 2 else f"(b {point.channels} n)"
        raise UserError(
            f"the points, argument {point.points!r} of the network, are {shape}, not {wanted} as in the "
            f"probe: hand them over like that, or graft with another points= or points_layout="
        )
    return (cloud if axis == 2 else cloud.transpose(1, 2))[..., :3].clone()


def with_points(
    which: int | str, cloud: Tensor, arguments: Sequence[Any], keywords: Mapping[str, Any]
) -> tuple[list[Any], dict[str, Any]]:
    """Return the arguments of a network by position and by keyword: the points, at `which`, and its other ones."""
    args, kwargs = list(arguments), dict(keywords)
    if isinstance(which, str):
        kwargs[which] = cloud
    else:
        args.insert(which, cloud)
    return args, kwargs


def _argument(which: int | str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
    if isinstance(which, str) and which in kwargs:
        return kwargs[which]
    if isinstance(which, int) and 0 <= which < len(args):
        return args[which]
    raise UserError(
        f"the points should be argument {which!r} of the network, which got {len(args)} by position and "
        f"{', '.join(kwargs) or 'none'} by keyword: hand them over there, or graft with another points="
    )


def channel_axis(layout: PointsLayout) -> Literal[1, 2]:
    """Axis of the channels in a batch of points."""
    return 2 if layout == "bnc" else 1


def to_bnc(output: Tensor, layout: Layout) -> Float[Tensor, "b n c"]:
    """Convert the output of a layer to channels last."""
    if layout == "bnc":
        return output
    return (output.squeeze(-1) if layout == "bcn1" else output).transpose(1, 2)


def from_bnc(features: Float[Tensor, "b n c"], layout: Layout) -> Tensor:
    """Convert features to the layout of the layer."""
    # Contiguous, like the layer's own output, since the network may take views of it.
    if layout == "bnc":
        return features.contiguous()
    transposed = features.transpose(1, 2).contiguous()
    return transposed.unsqueeze(-1) if layout == "bcn1" else transposed


def check_output(point: InjectionPoint, output: Any, points: Tensor) -> None:
    """Refuse what is not k features for each point, in the layout and width of the injection point."""
    rows, count = points.shape[0], point.multiple * points.shape[1]
    expected = {
        "bnc": (rows, count, point.width),
        "bcn": (rows, point.width, count),
        "bcn1": (rows, point.width, count, 1),
    }[point.layout]
    if not isinstance(output, Tensor) or output.shape != expected:
        shape = tuple(output.shape) if isinstance(output, Tensor) else f"a {type(output).__name__}"
        number = "one feature" if point.multiple == 1 else f"{point.multiple} features"
        raise UserError(
            f"layer '{point.at}' gives {shape} for {rows} × {points.shape[1]} points, not {number} of {point.width} "
            f"channels for each as '{point.layout}': graft at a layer ahead of any sampling, and state the layout it "
            f"has"
        )
