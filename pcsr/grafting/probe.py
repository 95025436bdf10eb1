"""Test runs of a foreign network, which find out how it is called, and what one of its layers gives."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from typing import Any

import torch
from torch import Tensor, nn

from pcsr.errors import UserError
from pcsr.grafting.calling import Calling, dense_rate
from pcsr.grafting.features import check_calls, find_features, hint
from pcsr.grafting.injection_point import InjectionPoint, channel_axis, check_output, with_points
from pcsr.grafting.layer_points import find_points
from pcsr.grafting.observation import NotRunError, Observation, Shape, observe, tensor_like
from pcsr.recipe.graft_section import Layout, PointsLayout

Probe = int | Sequence[int] | Tensor


@dataclass(frozen=True)
class Question:
    """What is asked of a network: the layer, its layout, and how the network is called."""

    at: str
    layout: Layout | None
    points: int | str
    arguments: Sequence[Any]
    keywords: Mapping[str, Any]


def probe_layer(
    network: nn.Module, question: Question, probe: Probe, points_layout: PointsLayout | None
) -> tuple[InjectionPoint, Calling]:
    """Run the network a few times, and look at what the layer gives.

    Raises:
        UserError: there is no such layer, it is not suitable, or the network cannot be run on the probe.
    """
    taken = question.points
    if isinstance(taken, int) and not 0 <= taken <= len(question.arguments):
        raise UserError(
            f"points={taken} is no position beside {len(question.arguments)} others: give those before it in arguments="
        )
    failures: dict[str, Shape] = {}
    for cloud, layout in _clouds(probe, points_layout, tensor_like(network)):
        axis = 3 - channel_axis(layout)
        if cloud.shape[3 - axis] < 3:
            raise UserError(f"the probe is {tuple(cloud.shape)}, which is no '{layout}' of at least 3 channels")
        try:
            return _probed(network, question, cloud, layout)
        except NotRunError as error:
            failures.setdefault(str(error), tuple(cloud.shape))
    find_layer(network, question.at)
    shown = "; nor ".join(f"on points of {shape}: {error}" for error, shape in failures.items())
    raise UserError(
        f"{type(network).__name__} cannot be run {shown}. Say with probe= which points it takes, and with arguments= "
        f"and keywords= what else it needs"
    )


def find_layer(network: nn.Module, at: str, hints: str = "") -> nn.Module:
    """Find the submodule with a dotted name.

    Raises:
        UserError: there is none; the message names similar ones, and ends with `hints`.
    """
    names = [name for name, _ in network.named_modules(remove_duplicate=False) if name]
    if at in names:
        return network.get_submodule(at)
    last = at.rpartition(".")[2]
    similar = [name for name in names if last and name.rpartition(".")[2] == last]
    similar = list(dict.fromkeys([*similar, *get_close_matches(at, names, n=5)]))[:5]
    remedy = f": did you mean {' or '.join(repr(name) for name in similar)}? {hints}"
    if not similar:
        remedy = f". {hints}" if hints else f": it has {', '.join(names[:8]) or 'none'}{' …' * (len(names) > 8)}"
    raise UserError(f"the network {type(network).__name__} has no layer '{at}'{remedy.rstrip()}")


def _probed(
    network: nn.Module, question: Question, cloud: Tensor, points_layout: PointsLayout
) -> tuple[InjectionPoint, Calling]:
    """Find the injection point, with points of a known layout.

    Raises:
        NotRunError: the network cannot be run on them.
    """
    axis = 3 - channel_axis(points_layout)
    names = {name for name, _ in network.named_modules(remove_duplicate=False) if name}
    at = question.at if question.at in names else None
    cloud = cloud if len(cloud) > 1 or question.layout else cloud.repeat(2, 1, 1)

    def run(points: Tensor) -> Observation:
        # Cloned, since a network may change its points in place.
        return observe(
            network, at, *with_points(question.points, points.clone(), question.arguments, question.keywords)
        )

    clouds, passes = [cloud], [run(cloud)]
    if question.layout is None:
        # Not the same points twice, since some networks fail on distances of zero.
        clouds.append(torch.cat([cloud, 0.9 * cloud], axis))
        try:
            passes.append(run(clouds[1]))
        except NotRunError:  # it takes one number of points only
            clouds.pop()
    rows, counts = len(cloud), [one.shape[axis] for one in clouds]
    if at is None:
        find_layer(network, question.at, hint(rows, counts, passes))
    calls = [one.outputs[question.at] for one in passes]
    try:
        for some in calls:
            check_calls(question.at, some)
        shapes = [some[0] for some in calls]
        layout, width, multiple = find_features(question.at, rows, counts, shapes, question.layout)
    except UserError as error:
        raise UserError(f"{error}. {hint(rows, counts, passes)}") from error
    point = InjectionPoint(question.at, layout, width, question.points, points_layout, cloud.shape[3 - axis], multiple)
    if multiple > 1:
        point = find_points(point, cloud, passes, lambda order: run(cloud.index_select(axis, order)))
    check_output(point, passes[0].features, cloud if axis == 1 else cloud.transpose(1, 2))
    rate = dense_rate(passes[0].result, rows, counts[0])
    others = (*question.arguments, *question.keywords.values())
    if rate is not None and not any(isinstance(one, Tensor) for one in others):  # which may have an axis of clouds
        alone = _takes_one_cloud(lambda: run(cloud[:1]), point.at, shapes[0][1:], (counts[0], rate))
        point = replace(point, smallest_batch=1 if alone else 2)
    return point, Calling(counts[0], rate, tuple(question.arguments), dict(question.keywords))


def _takes_one_cloud(run: Callable[[], Observation], at: str, shape: Shape, sizes: tuple[int, int]) -> bool:
    """Return whether the network gives the features and the dense cloud of a batch of one cloud.

    Args:
        run: runs the network on one cloud.
        at: the layer.
        shape: shape of the layer's output, without the axis of clouds.
        sizes: number of points of the cloud, and the rate.
    """
    try:
        alone = run()
    except NotRunError:
        return False
    return alone.outputs[at] == [(1, *shape)] and dense_rate(alone.result, 1, sizes[0]) == sizes[1]


def _clouds(probe: Probe, layout: PointsLayout | None, like: Tensor) -> Iterator[tuple[Tensor, PointsLayout]]:
    """Yield the points to try, with their layout: both layouts if a number of points is given."""
    if isinstance(probe, int):
        if probe < 1:
            raise UserError(f"probe={probe}: give a number of points, or the points or their shape")
        layouts: Sequence[PointsLayout] = ("bnc", "bcn") if layout is None else (layout,)
        for one in layouts:
            yield _random_cloud((2, probe, 3) if one == "bnc" else (2, 3, probe)).to(like), one
        return
    cloud = probe if isinstance(probe, Tensor) else _random_cloud(probe).to(like)
    if cloud.dim() != 3 or min(cloud.shape) == 0:
        raise UserError(f"the probe is {tuple(cloud.shape)}: points are (b n 3) or (b 3 n)")
    yield cloud, layout or _points_layout(tuple(cloud.shape))


def _random_cloud(shape: Sequence[int]) -> Tensor:
    return torch.rand(tuple(shape), generator=torch.Generator().manual_seed(0)) * 2 - 1


def _points_layout(shape: tuple[int, ...]) -> PointsLayout:
    threes = [axis for axis in (1, 2) if shape[axis] == 3]
    if len(threes) == 1:
        return "bnc" if threes[0] == 2 else "bcn"
    raise UserError(
        f"the probe {shape} does not show which axis holds the coordinates: give another number of points than 3, or "
        f"say points_layout='bnc' or 'bcn'"
    )
