"""The points of a layer that has several features for each input point, as in the second stage of a cascade."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import torch
from torch import Tensor, nn
from torch.utils.hooks import RemovableHandle

from pcsr.errors import UserError
from pcsr.grafting.injection_point import InjectionPoint, Order, SeenPoints, channel_axis, to_bnc
from pcsr.grafting.observation import NotRunError, Observation
from pcsr.tensors import Points

NEAR = 0.25
"""A tensor holds the points of a layer if its points and those of the input are on average nearer to each other than
this share of the input's radius."""
TOLERANCE = 1e-3
"""Largest difference of the features of a permuted cloud, in standard deviations of the features."""


def find_points(
    point: InjectionPoint, cloud: Tensor, passes: Sequence[Observation], permuted: Callable[[Tensor], Observation]
) -> InjectionPoint:
    """Find the points of a layer with k features for each input point.

    These are the last cloud of k·n points near the input that the network shows ahead of the layer, as an argument or
    output of a module. Without one they are k copies of the input points, whose order the features of a permuted cloud
    show.

    Args:
        point: the layer.
        cloud: points of the probe.
        passes: of the network; the first of them on `cloud`.
        permuted: runs the network on the points of `cloud` in another order.

    Raises:
        UserError: there is no such cloud, and the features do not show the order of the copies.
    """
    axis = 3 - channel_axis(point.points_layout)
    points = (cloud if axis == 1 else cloud.transpose(1, 2))[..., :3].float()
    size = point.multiple * points.shape[1]
    for seen, tensor in reversed(passes[0].clouds):
        found = _channels_last(seen, tensor)
        also = [seen in [other for other, _ in one.clouds] for one in passes]
        if found.shape[:2] == (len(points), size) and all(also) and _near(found[0].float(), points[0]):
            return replace(point, seen=seen)
    return replace(point, order=_order(point, points.shape[1], passes[0], permuted))


def _near(one: Tensor, points: Tensor) -> bool:
    radius = (points - points.mean(0)).norm(dim=1).max()
    distance = torch.cdist(one, points)
    return bool(torch.maximum(distance.amin(0).mean(), distance.amin(1).mean()) < NEAR * radius)


def _order(
    point: InjectionPoint, count: int, observed: Observation, permuted: Callable[[Tensor], Observation]
) -> Order:
    """Return the order of the copies: that in which the features of a permuted cloud are the permuted features."""
    turned = torch.randperm(count, generator=torch.Generator().manual_seed(0))
    try:
        features, of_permuted = observed.features, permuted(turned).features
    except NotRunError:
        of_permuted = None
    if features is not None and of_permuted is not None and features.shape == of_permuted.shape:
        first, second = to_bnc(features, point.layout), to_bnc(of_permuted, point.layout)
        copies = torch.arange(point.multiple)
        orders: dict[Order, Tensor] = {
            "interleaved": (turned[:, None] * point.multiple + copies).flatten(),
            "tiled": (turned + count * copies[:, None]).flatten(),
        }
        for order, rows in orders.items():
            if (first[:, rows] - second).abs().max() <= TOLERANCE * first.std():
                return order
    raise UserError(
        f"layer '{point.at}' has {point.multiple} features for each point, and the network shows neither their points "
        f"nor their order: graft at a layer with one feature for each point"
    )


class LayerPoints:
    """The points of a grafted layer in one pass of the network."""

    def __init__(self, point: InjectionPoint, points: Points) -> None:
        self.point, self.points = point, points
        self.seen: Tensor | None = None

    def watch(self, network: nn.Module, here: Callable[[], bool]) -> list[RemovableHandle]:
        """Add the hook that keeps the points that a module shows; `here` tells whether it is called for this pass."""
        seen = self.point.seen
        if seen is None:
            return []
        module = network.get_submodule(seen.module)

        def keep(value: Any) -> None:
            size = (self.points.shape[0], self.point.multiple * self.points.shape[1], 3)
            if here() and isinstance(value, Tensor) and value.dim() == 3:
                found = _channels_last(seen, value)
                if found.shape == size:
                    self.seen = found.clone()  # networks may change it in place

        def before(_module: nn.Module, args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> None:
            if isinstance(seen.argument, str):
                keep(kwargs.get(seen.argument))
            elif seen.argument is not None and seen.argument < len(args):
                keep(args[seen.argument])

        def after(_module: nn.Module, _args: Any, output: Any) -> None:
            keep(output)

        if seen.argument is None:
            return [module.register_forward_hook(after)]
        return [module.register_forward_pre_hook(before, with_kwargs=True)]

    def get(self) -> Points:
        """Return the points of the layer's features, (b kn 3).

        Raises:
            UserError: the module that has shown them at the probe did not in this pass.
        """
        if self.point.seen is None:
            if self.point.order == "interleaved":
                return self.points.repeat_interleave(self.point.multiple, 1)
            return self.points if self.point.multiple == 1 else self.points.repeat(1, self.point.multiple, 1)
        if self.seen is None:
            raise UserError(
                f"the points of layer '{self.point.at}' are not in '{self.point.seen.module}' in this pass, where the "
                f"probe found them: graft again, or at a layer with one feature for each point"
            )
        return self.seen


def _channels_last(seen: SeenPoints, tensor: Tensor) -> Tensor:
    return tensor if seen.layout == "bnc" else tensor.transpose(1, 2)
