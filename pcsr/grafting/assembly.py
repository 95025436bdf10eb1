"""The assembly of a graft: a network, one of its layers, a fusion and a touch encoder."""

from collections.abc import Mapping, Sequence
from typing import Any, get_args

from torch import Tensor, nn

from pcsr.contracts import Encoder, Fusion
from pcsr.errors import UserError, did_you_mean
from pcsr.grafting.grafted import Grafted
from pcsr.grafting.injection_point import InjectionPoint, Layout, PointsLayout
from pcsr.grafting.parts import build_parts, try_parts
from pcsr.grafting.probe import probe_layer, tensor_like
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Registry


def graft(
    network: nn.Module,
    at: str,
    *,
    fusion: str | Mapping[str, Any] | Fusion = "iterative",
    touch_encoder: str | Mapping[str, Any] | Encoder | None = "default",
    probe: Sequence[int] | Tensor = (2, 256, 3),
    layout: str | None = None,
    points: int | str = 0,
    points_layout: str | None = None,
    arguments: Sequence[Any] = (),
    keywords: Mapping[str, Any] | None = None,
    registry: Registry | None = None,
) -> Grafted:
    """Fuse touch into a network at the layer `at`, whose output is one feature for each of its input points.

    The network is run once or twice, in `eval` mode and without gradients, to find the layout and width of the output.

    Args:
        network: any module that maps points to points.
        at: dotted name of the layer, as in `network.named_modules()`.
        fusion: by name, as `{"use": name, **options}`, or an instance built for the layer's channels.
        touch_encoder: the same, or None: the coordinates themselves. By default a `unet` with a quarter of the
            layer's channels, at least 8.
        probe: points that the network is run on, or their shape, (b n 3) or (b 3 n).
        layout: of the layer's output, "bnc", "bcn" or "bcn1". By default a second run shows it.
        points: the network's argument for the points: a position or a keyword.
        points_layout: of the points, "bnc" or "bcn", if the probe does not show it.
        arguments: the network's other positional arguments, for the probe.
        keywords: its keyword arguments, for the probe.
        registry: of parts; by default the installed ones.

    Raises:
        UserError: no such layer, one that does not give a feature for each point, a network that fails on the
            probe, or parts that do not exist or fit; the message says which.

    Examples:
        >>> network = torch.nn.Sequential(torch.nn.Linear(3, 16), torch.nn.ReLU(), torch.nn.Linear(16, 3))
        >>> grafted = pcsr.graft(network, at="0", probe=(1, 32, 3))
        >>> points, touches = torch.rand(1, 32, 3), torch.rand(1, 2, 8, 3)
        >>> grafted(points, touches=touches).shape
        torch.Size([1, 32, 3])
    """
    stated, of_points = _stated("layout", layout, Layout), _stated("points_layout", points_layout, PointsLayout)
    injection_point = probe_layer(network, at, stated, points, of_points, probe, arguments, keywords or {})
    return assemble(network, injection_point, fusion, touch_encoder, registry)


def assemble(
    network: nn.Module,
    injection_point: InjectionPoint,
    fusion: str | Mapping[str, Any] | Fusion,
    touch_encoder: str | Mapping[str, Any] | Encoder | None,
    registry: Registry | None,
) -> Grafted:
    """Build the tactile parts for the injection point, beside the network's weights, and try them once."""
    built, encoder, specs = build_parts(
        injection_point.width, fusion, touch_encoder, load_plugins() if registry is None else registry
    )
    like = tensor_like(network)
    grafted = Grafted(network, built, encoder, injection_point, specs)
    for part in filter(None, (built, encoder)):
        part.to(like.device, like.dtype).train(network.training)
    try_parts(grafted, like)
    return grafted


def _stated(option: str, value: str | None, known: Any) -> Any:
    if value is not None and value not in get_args(known):
        raise UserError(f"{option}={value!r} is unknown: {did_you_mean(value, get_args(known))}")
    return value
