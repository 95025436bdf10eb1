"""Test runs of a foreign network, which find the layout and width of a layer's output."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any

import torch
from torch import Tensor, nn

from pcsr.errors import UserError
from pcsr.grafting.injection_point import InjectionPoint, Layout, PointsLayout, channel_axis, check_output

Shape = tuple[int, ...]


def probe_layer(
    network: nn.Module,
    at: str,
    layout: Layout | None,
    points: int | str,
    points_layout: PointsLayout | None,
    probe: Sequence[int] | Tensor,
    arguments: Sequence[Any],
    keywords: Mapping[str, Any],
) -> InjectionPoint:
    """Run the network, twice where the layout is not stated, and look at what the layer gives."""
    layer = find_layer(network, at)
    if isinstance(points, int) and not 0 <= points <= len(arguments):
        raise UserError(
            f"points={points} is no position beside {len(arguments)} others: give those before it in arguments="
        )
    like = tensor_like(network)
    cloud = probe if isinstance(probe, Tensor) else _random_cloud(probe).to(like)
    if cloud.dim() != 3 or min(cloud.shape) == 0:
        raise UserError(f"the probe is {tuple(cloud.shape)}: points are (b n 3) or (b 3 n)")
    points_layout = points_layout or _points_layout(tuple(cloud.shape))
    axis = 3 - channel_axis(points_layout)
    if cloud.shape[3 - axis] < 3:
        raise UserError(f"the probe is {tuple(cloud.shape)}, which is no '{points_layout}' of at least 3 channels")
    clouds = [cloud]
    if layout is None:
        cloud = cloud if len(cloud) > 1 else cloud.repeat(2, 1, 1)
        # Not the same points twice, since some networks fail on distances of zero.
        clouds = [cloud, torch.cat([cloud, 0.9 * cloud], axis)]
    outputs = []
    for one in clouds:
        args, kwargs = list(arguments), dict(keywords)
        if isinstance(points, str):
            kwargs[points] = one
        else:
            args.insert(points, one)
        outputs.append(_output(network, layer, at, args, kwargs, tuple(one.shape)))
    shapes = [tuple(output.shape) for output in outputs]
    counts = [one.shape[axis] for one in clouds]
    if layout is not None:
        width = shapes[0][2 if layout == "bnc" else 1] if len(shapes[0]) > 2 else 0
    else:
        layout, width = _find(at, counts, shapes)
    injection_point = InjectionPoint(at, layout, width, points, points_layout, cloud.shape[3 - axis])
    for one, output in zip(clouds, outputs, strict=True):
        check_output(injection_point, output, one if axis == 1 else one.transpose(1, 2))
    return injection_point


def find_layer(network: nn.Module, at: str) -> nn.Module:
    """Find the submodule with a dotted name."""
    names = [name for name, _ in network.named_modules(remove_duplicate=False) if name]
    if at in names:
        return network.get_submodule(at)
    last = at.rpartition(".")[2]
    similar = [name for name in names if last and name.rpartition(".")[2] == last]
    similar = list(dict.fromkeys([*similar, *get_close_matches(at, names, n=5)]))[:5]
    if similar:
        remedy = f"did you mean {' or '.join(repr(name) for name in similar)}?"
    else:
        remedy = f"it has {', '.join(names[:8]) or 'none'}{' …' if len(names) > 8 else ''}"
    raise UserError(f"the network {type(network).__name__} has no layer '{at}': {remedy}")


def tensor_like(network: nn.Module) -> Tensor:
    """A tensor with the data type and device of the network's weights."""
    return next((weight for weight in network.parameters() if weight.is_floating_point()), torch.zeros(()))


def _random_cloud(shape: Sequence[int]) -> Tensor:
    return torch.rand(tuple(shape), generator=torch.Generator().manual_seed(0)) * 2 - 1


def _points_layout(shape: Shape) -> PointsLayout:
    threes = [axis for axis in (1, 2) if shape[axis] == 3]
    if len(threes) == 1:
        return "bnc" if threes[0] == 2 else "bcn"
    raise UserError(
        f"the probe {shape} does not show which axis holds the coordinates: give another number of points than 3, or "
        f"say points_layout='bnc' or 'bcn'"
    )


def _output(
    network: nn.Module, layer: nn.Module, at: str, args: Sequence[Any], kwargs: Mapping[str, Any], shape: Shape
) -> Tensor:
    """Output of a layer in one run of the network, whose state does not change."""
    outputs: list[Any] = []
    handle = layer.register_forward_hook(lambda _layer, _args, output: outputs.append(output))
    try:
        with quiet(network, tensor_like(network).device):
            network(*args, **kwargs)
    except Exception as error:  # foreign code may raise any error
        raise UserError(
            f"{type(network).__name__} cannot be run on points of {shape}: {type(error).__name__}: {one_line(error)}. "
            f"Say with probe= which points it takes, with arguments= and keywords= what else it needs, and with "
            f"layout= what the layer gives if it takes no other number of points"
        ) from error
    finally:
        handle.remove()
    if len(outputs) != 1:
        raise UserError(
            f"layer '{at}' is called {len(outputs)} times in one pass, and touch is fused at one call: graft at a "
            f"layer that is called once (a compiled or scripted network calls none of its layers)"
        )
    if not isinstance(outputs[0], Tensor):
        inner = [f"'{at}.{name}'" for name, _ in layer.named_children()]
        remedy = f"a layer inside of it, such as {' or '.join(inner[:5])}" if inner else "another layer"
        raise UserError(f"layer '{at}' gives a {type(outputs[0]).__name__}, not a tensor: graft at {remedy}")
    return outputs[0]


@contextmanager
def quiet(network: nn.Module, device: torch.device) -> Iterator[None]:
    """Disable gradients and set `eval` mode; random state and modes are restored afterwards."""
    modes = [(module, module.training) for module in network.modules()]
    devices = [device] if device.type == "cuda" else []
    try:
        with torch.no_grad(), torch.random.fork_rng(devices):
            network.eval()
            yield
    finally:
        for module, training in modes:
            module.training = training


def _find(at: str, counts: Sequence[int], shapes: Sequence[Shape]) -> tuple[Layout, int]:
    """Find layout and width of a layer from its output for two numbers of points."""
    (n, more), (first, second) = counts, shapes
    shown = f"layer '{at}' gives {first} for {n} points and {second} for {more}"
    axes = range(1, min(len(first), len(second)))
    along = [axis for axis in axes if (first[axis], second[axis]) == (n, more)]
    moved = [axis for axis in axes if first[axis] != second[axis]]
    if len(along) > 1 or (along and moved != along):
        raise UserError(f"{shown}: its width is ambiguous: state it with layout='bnc', 'bcn' or 'bcn1'")
    if not along and len(moved) == 1:
        raise UserError(f"{shown}: another number of points than the input, as after a sampling: graft ahead of it")
    known: dict[tuple[int, int], tuple[Layout, int]] = {(3, 1): ("bnc", 2), (3, 2): ("bcn", 1), (4, 2): ("bcn1", 1)}
    found = known.get((len(first), along[0])) if along else None
    if found is None or (len(first) == 4 and first[3] != 1):
        raise UserError(f"{shown}: not one feature for each point, as (b n c), (b c n) or (b c n 1): graft elsewhere")
    return found[0], first[found[1]]


def one_line(thing: object) -> str:
    """The text of an object without line breaks."""
    return " ".join(str(thing).split())
