"""The assembly of a graft: a network, one of its layers, a fusion and a touch encoder."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, get_args

from torch import Tensor, nn

from pcsr.contracts import Encoder, Fusion
from pcsr.errors import UserError, did_you_mean
from pcsr.grafting.grafted import Grafted
from pcsr.grafting.observation import tensor_like
from pcsr.grafting.parts import build_parts, try_parts
from pcsr.grafting.probe import Question, probe_layer
from pcsr.plugins.loading import check_loaded, load_plugins, plugin_paths
from pcsr.plugins.registry import Registry
from pcsr.recipe.graft_section import Layout, PointsLayout
from pcsr.validation_messages import shown

SomeGrafted = TypeVar("SomeGrafted", bound=Grafted)


def graft(
    network: nn.Module,
    at: str,
    *,
    fusion: str | Mapping[str, Any] | Fusion = "iterative",
    touch_encoder: str | Mapping[str, Any] | Encoder | None = "default",
    probe: int | Sequence[int] | Tensor = 256,
    layout: str | None = None,
    points: int | str = 0,
    points_layout: str | None = None,
    arguments: Sequence[Any] = (),
    keywords: Mapping[str, Any] | None = None,
    frozen: bool = True,
    plugins: Sequence[str | Path] = (),
    registry: Registry | None = None,
) -> Grafted:
    """Fuse touch into a network at the layer `at`, whose output is one feature for each of its input points, or k.

    The network is run a few times, in `eval` mode and without gradients, to find the layouts of its points and of the
    layer's output. It stays in `eval` mode while it is frozen.

    Args:
        network: any module that maps points to points.
        at: dotted name of the layer, as in `network.named_modules()`.
        fusion: by name, as `{"use": name, **options}`, or an instance built for the layer's channels.
        touch_encoder: the same, or None: the coordinates themselves. By default a `unet` with a quarter of the
            layer's channels, at least 8.
        probe: number of points that the network is run on, their shape, (b n 3) or (b 3 n), or the points themselves.
        layout: of the layer's output, "bnc", "bcn" or "bcn1". By default a second run shows it.
        points: the network's argument for the points: a position or a keyword.
        points_layout: of the points, "bnc" or "bcn"; by default the one that the network can be run on.
        arguments: the network's other positional arguments, for the probe.
        keywords: its keyword arguments, for the probe.
        frozen: whether the network stays in `eval` mode when the graft is trained. False to train it along.
        plugins: Python files with further fusions and encoders.
        registry: of parts, instead of the installed ones and those of `plugins`.

    Raises:
        UserError: no such layer, one that does not give features for each point, a network that fails on the
            probe, or parts that do not exist or fit; the message says which, and names suitable layers.

    Examples:
        >>> network = torch.nn.Sequential(torch.nn.Linear(3, 16), torch.nn.ReLU(), torch.nn.Linear(16, 3))
        >>> grafted = pcsr.graft(network, at="0")
        >>> points, touches = torch.rand(1, 32, 3), torch.rand(1, 2, 8, 3)
        >>> grafted(points, touches=touches).shape
        torch.Size([1, 32, 3])
    """
    if not isinstance(network, nn.Module):
        raise UserError(f"the network is {shown(network)}: give a torch.nn.Module, an instance of its class")
    if not isinstance(at, str):
        raise UserError(f"at={shown(at)}: give the dotted name of a layer, as in network.named_modules()")
    stated, of_points = _stated("layout", layout, Layout), _stated("points_layout", points_layout, PointsLayout)
    if registry is None:
        registry = load_plugins(plugin_paths(plugins))
        check_loaded(registry)
    question = Question(at, stated, points, tuple(arguments), dict(keywords or {}))
    injection_point, calling = probe_layer(network, question, probe, of_points)
    built, encoder, specs = build_parts(injection_point.width, fusion, touch_encoder, registry)
    grafted = assemble(Grafted, network, built, encoder, injection_point, specs, calling, frozen=frozen)
    try_parts(grafted, tensor_like(network))
    return grafted


def assemble(
    kind: type[SomeGrafted],
    network: nn.Module,
    fusion: Fusion,
    touch_encoder: Encoder | None,
    *about: Any,
    frozen: bool,
) -> SomeGrafted:
    """Put a graft together; its tactile parts get the network's device, data type and mode."""
    training, like = network.training, tensor_like(network)
    for part in filter(None, (fusion, touch_encoder)):
        part.to(like.device, like.dtype).train(training)
    return kind(network, fusion, touch_encoder, *about, frozen=frozen)


def _stated(option: str, value: str | None, known: Any) -> Any:
    if value is not None and value not in get_args(known):
        raise UserError(f"{option}={value!r} is unknown: {did_you_mean(value, get_args(known))}")
    return value
