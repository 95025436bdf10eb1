"""Touch on a network of somebody else's: what one of its layers gives is fused with the touches.

The foreign code stays as it is. While a graft calls the network, a hook on the layer puts the fused features in
the place of the visual ones; without touches there is no hook, and the network is called as if it were alone.
"""

import json
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from difflib import get_close_matches
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, get_args

import torch
from jaxtyping import Float
from pydantic import ValidationError
from safetensors import SafetensorError, safe_open
from torch import Tensor, nn

from pcsr.contracts import Encoder, Fusion, Widths
from pcsr.errors import UserError, did_you_mean
from pcsr.files import save_tensors
from pcsr.model import fuse
from pcsr.plugins import load_plugins
from pcsr.recipe.schema import PartSpec, options_model
from pcsr.registry import Registry
from pcsr.tensors import Points

Layout = Literal["bnc", "bcn", "bcn1"]
PointsLayout = Literal["bnc", "bcn"]
Shape = tuple[int, ...]

FAR = 10.0
"""Radii of a cloud: touches whose centres all lie further from its centre are in another frame or unit."""


@dataclass(frozen=True)
class Joint:
    """Where touch enters a network."""

    at: str
    """Dotted name of the layer."""
    layout: Layout
    """Of what the layer gives: (b n c), (b c n) or (b c n 1)."""
    width: int
    """Its channels."""
    points: int | str = 0
    """Which argument of the network the points are: a position, or a keyword."""
    points_layout: PointsLayout = "bnc"
    """(b n 3) or (b 3 n)."""
    channels: int = 3
    """Of the points: those behind the first three are no coordinates."""


class Grafted(nn.Module):
    """A network that hears touch at one of its layers; without touches, bit for bit the network alone."""

    def __init__(
        self,
        network: nn.Module,
        fusion: Fusion,
        touch_encoder: Encoder | None,
        joint: Joint,
        specs: dict[str, Any],
    ) -> None:
        super().__init__()
        self.network = network
        self.fusion = fusion
        self.touch_encoder = touch_encoder
        self.joint = joint
        self.specs = specs

    def forward(self, *args: Any, touches: Tensor | None = None, mask: Tensor | None = None, **kwargs: Any) -> Any:
        """What the network gives, with the touches heard at the joint.

        Args:
            *args: the network's own, handed through.
            touches: (b a m 3), in the frame and unit of the points; none by default.
            mask: (b a), False where a row holds fewer than `a` touches; all True by default.
            **kwargs: the network's own, handed through.

        Raises:
            UserError: touches of another shape, type, frame or unit than the points, or a layer that did not give
                one feature for each point, once.
        """
        if touches is None:
            if mask is not None:
                raise UserError(
                    "mask says which touches there are, but there are no touches: leave it out; an argument of the "
                    "network's own that is called mask goes by its position"
                )
            return self.network(*args, **kwargs)
        points = self._points(args, kwargs)
        mask = torch.ones(touches.shape[:2], dtype=torch.bool, device=touches.device) if mask is None else mask
        _check_touches(points, touches, mask)
        exporting = torch.compiler.is_exporting()  # then what the tensors hold is not known
        if touches.shape[1] == 0 or not (exporting or mask.any()):
            return self.network(*args, **kwargs)
        if not exporting:
            _check_frame(points, touches, mask)
        if isinstance(self.network, Grafted):  # a second joint: both hear the same touches
            kwargs |= {"touches": touches, "mask": mask}
        return self._touched(points, touches, mask, args, kwargs)

    def tactile_parameters(self) -> Iterator[nn.Parameter]:
        """The parameters that the foreign network does not have: those of the fusion and the touch encoder."""
        foreign: nn.Module = self.network
        while isinstance(foreign, Grafted):
            foreign = foreign.network
        theirs = {id(parameter) for parameter in foreign.parameters()}
        return (parameter for parameter in self.parameters() if id(parameter) not in theirs)

    def _points(self, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Float[Tensor, "b n 3"]:
        """The visual points; a copy, as networks may centre theirs in place before the layer is reached."""
        cloud = _argument(self.joint.points, args, kwargs)
        axis = _channel_axis(self.joint.points_layout)
        if not isinstance(cloud, Tensor) or cloud.dim() != 3 or cloud.shape[axis] != self.joint.channels:
            shape = tuple(cloud.shape) if isinstance(cloud, Tensor) else type(cloud).__name__
            wanted = f"(b n {self.joint.channels})" if axis == 2 else f"(b {self.joint.channels} n)"
            raise UserError(
                f"the points, argument {self.joint.points!r} of the network, are {shape}, not {wanted} as in the "
                f"probe: hand them over like that, or graft with another points= or points_layout="
            )
        return (cloud if axis == 2 else cloud.transpose(1, 2))[..., :3].clone()

    def _touched(
        self, points: Points, touches: Tensor, mask: Tensor, args: Sequence[Any], kwargs: Mapping[str, Any]
    ) -> Any:
        """Call the network with the hook in place, and take it away again whatever happens."""
        at, layout = self.joint.at, self.joint.layout
        caller, learning = threading.get_ident(), torch.is_grad_enabled()
        calls = 0

        def hook(_layer: nn.Module, _args: Any, output: Any) -> Tensor | None:
            nonlocal calls
            if threading.get_ident() != caller:  # replicas on several devices share the hooks of a layer
                return None
            calls += 1
            if calls > 1:
                raise UserError(f"layer '{at}' was called again within one pass: graft at a layer that is called once")
            if learning and not torch.is_grad_enabled() and any(p.requires_grad for p in self.tactile_parameters()):
                raise UserError(
                    f"layer '{at}' runs without gradients, so its graft would learn nothing: graft at a layer outside "
                    f"of torch.no_grad() and of checkpointed blocks, or call the graft under torch.no_grad()"
                )
            _check_output(self.joint, output, points)
            features = _to_bnc(output, layout)
            fused = fuse(self.fusion, self.touch_encoder, points, features, touches, mask)
            if torch.compiler.is_exporting():  # `fuse` leaves out nobody there
                fused = torch.where(mask.any(1)[:, None, None], fused, features)
            return _from_bnc(fused.to(output.dtype), layout)

        handle = self.network.get_submodule(at).register_forward_hook(hook)
        try:
            result = self.network(*args, **kwargs)
        finally:
            handle.remove()
        if not calls:
            raise UserError(
                f"layer '{at}' was not called in this pass, so the touches were not heard: graft at a layer that "
                f"every pass goes through"
            )
        return result


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
    """Let a network hear touch at the layer `at`, whose output is one feature for each of its input points.

    The network is run once or twice, in `eval` mode and without gradients, to see what the layer gives.

    Args:
        network: any module that maps points to points.
        at: dotted name of the layer, as in `network.named_modules()`.
        fusion: by name, as `{"use": name, **options}`, or an instance made for the layer's channels.
        touch_encoder: the same, or None: the coordinates themselves. By default a `unet` with a quarter of the
            layer's channels, at least 8.
        probe: points that the network is run on, or their shape, (b n 3) or (b 3 n).
        layout: of the layer's output, "bnc", "bcn" or "bcn1". Else found out by a second run with twice as many points.
        points: the argument that the points are: a position or a keyword.
        points_layout: of the points, "bnc" or "bcn", where the probe does not show it.
        arguments: the network's other positional arguments, for the probe.
        keywords: its keyword arguments, for the probe.
        registry: where parts are looked up; by default all that are installed.

    Raises:
        UserError: no such layer, one that does not give a feature for each point, a network that fails on the
            probe, or parts that do not exist or fit; the message says which.
    """
    stated, of_points = _stated("layout", layout, Layout), _stated("points_layout", points_layout, PointsLayout)
    joint = _probe(network, at, stated, points, of_points, probe, arguments, keywords or {})
    return _assemble(network, joint, fusion, touch_encoder, registry)


def save_graft(path: Path | str, grafted: Grafted, about: Mapping[str, Any] | None = None) -> None:
    """Write the weights of the network and of its tactile parts; the header says what to rebuild and `about`.

    Raises:
        UserError: a tactile part was given as an instance, which a file cannot describe, or `about` is not what
            JSON can write.
    """
    nameless = [kind for kind, spec in grafted.specs.items() if spec == "instance"]
    if nameless:
        raise UserError(
            f"the {nameless[0]} of this graft was given as an instance, so that a file cannot say how to build it: "
            f"register its class in a plugin and give its name, or save grafted.state_dict() yourself"
        )
    card = {"graft": {"joint": asdict(grafted.joint), **grafted.specs}, "about": dict(about or {})}
    try:
        header = json.dumps(card)
    except TypeError as error:
        raise UserError(f"about={about!r}: the header of a graft is what JSON can write, but {error}") from error
    # Cloned, as weights that two layers share are refused by safetensors.
    tensors = {name: tensor.detach().clone() for name, tensor in grafted.state_dict().items()}
    save_tensors(Path(path), tensors, {"pcsr": header})


def load_graft(path: Path | str, network: nn.Module, registry: Registry | None = None) -> Grafted:
    """The graft that `save_graft` wrote, in `eval` mode, on `network`, whose weights are overwritten too.

    Raises:
        UserError: no file of `save_graft`, a part that is not installed, or another network; the message names
            the weights that differ, and nothing is changed.
    """
    path = Path(path)
    tensors, joint, fusion, touch_encoder = _read(path)
    _layer(network, joint.at)
    grafted = _assemble(network, joint, fusion, touch_encoder, registry)
    wanted = grafted.state_dict()
    wrong = [f"the file has no {name}" for name in wanted if name not in tensors]
    wrong += [f"the network has no {name}" for name in tensors if name not in wanted]
    wrong += [
        f"{name} is {tuple(tensors[name].shape)} in the file, {tuple(tensor.shape)} in the network"
        for name, tensor in wanted.items()
        if name in tensors and tensors[name].shape != tensor.shape
    ]
    if wrong:
        more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
        raise UserError(
            f"{path} was saved from another network than this {type(network).__name__}: {'; '.join(wrong[:3])}{more}. "
            f"Build the network as it was when it was saved"
        )
    grafted.load_state_dict(tensors)
    return grafted.eval()


def _stated(option: str, value: str | None, known: Any) -> Any:
    if value is not None and value not in get_args(known):
        raise UserError(f"{option}={value!r} is unknown: {did_you_mean(value, get_args(known))}")
    return value


def _read(path: Path) -> tuple[dict[str, Tensor], Joint, Any, Any]:
    if not path.is_file():
        raise UserError(f"{path}: there is no such file of a graft")
    try:
        with safe_open(path, "pt") as file:
            card = json.loads((file.metadata() or {})["pcsr"])["graft"]
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            return tensors, Joint(**card["joint"]), card["fusion"], card["touch_encoder"]
    except (SafetensorError, KeyError, TypeError, ValueError) as error:
        raise UserError(
            f"{path} is not a file of save_graft ({type(error).__name__}: {error}): save the graft again"
        ) from error


def _assemble(
    network: nn.Module,
    joint: Joint,
    fusion: str | Mapping[str, Any] | Fusion,
    touch_encoder: str | Mapping[str, Any] | Encoder | None,
    registry: Registry | None,
) -> Grafted:
    """Build the tactile parts for the joint, beside the network's weights, and try them once."""
    if registry is None:
        registry = load_plugins()
    if touch_encoder == "default":
        width = max(8, joint.width // 4)
        touch_encoder = {"use": "unet", "channels": width + width % 2}  # a unet halves its channels at the entrance
    encoder, encoder_spec = None, None
    if touch_encoder is not None:
        encoder, encoder_spec = _part("encoder", touch_encoder, Widths(), registry)
    widths = Widths(visual=joint.width, touch=encoder.channels if encoder else 3)
    built, fusion_spec = _part("fusion", fusion, widths, registry)
    if not built.hears_features or type(built).join is not Fusion.join:
        raise UserError(
            f"fusion '{fusion_spec['use'] if isinstance(fusion_spec, dict) else type(built).__name__}' joins touched "
            f"points to the cloud, and a graft cannot tell which outputs of the network to thin afterwards: take a "
            f"fusion of features, or join them yourself: network(torch.cat([points, touches.flatten(1, 2)], 1))"
        )
    specs = {"fusion": fusion_spec, "touch_encoder": encoder_spec}
    like = _like(network)
    grafted = Grafted(network, built, encoder, joint, specs)
    for part in filter(None, (built, encoder)):
        part.to(like.device, like.dtype).train(network.training)
    _try(grafted, like)
    return grafted


def _part(kind: str, given: Any, widths: Widths, registry: Registry) -> tuple[Any, Any]:
    """A part and what to write in a file to build it again: its name and all its options."""
    contract = {"encoder": Encoder, "fusion": Fusion}[kind]
    if isinstance(given, contract):
        return given, "instance"
    written = {"use": given} if isinstance(given, str) else dict(given) if isinstance(given, Mapping) else {}
    name = written.pop("use", None)
    if not isinstance(name, str):
        raise UserError(
            f"{kind} {_one_line(given)}: give a name, {{'use': name, …options}} or a pcsr.{contract.__name__}"
        )
    try:
        model = options_model(registry.get(kind, name))
    except (TypeError, NameError) as error:
        raise UserError(f"the options of {kind} '{name}' cannot be read off its constructor: {error}") from error
    try:
        checked = model.model_validate_json(json.dumps(written))
    except TypeError as error:
        raise UserError(f"{kind} '{name}': options are what JSON can write, but {error}") from error
    except ValidationError as error:
        mistakes = [_mistake(f"{kind} '{name}'", one, model.model_fields) for one in error.errors()]
        raise UserError("; ".join(mistakes)) from error
    options = {key: getattr(checked, key) for key in model.model_fields}
    try:
        built = PartSpec(use=name, options=options).build(registry, kind, widths)
    except (RuntimeError, ValueError) as error:  # such as torch's, about a negative number of channels
        raise UserError(f"{kind} '{name}' cannot be built with {options}: {_one_line(error)}") from error
    return built, {"use": name, **options}


def _mistake(owner: str, error: Mapping[str, Any], known: Mapping[str, Any]) -> str:
    """One of pydantic's errors as a recipe would say it."""
    key = ".".join(map(str, error["loc"]))
    if error["type"] == "extra_forbidden":
        return f"{owner} takes no '{key}': {did_you_mean(key, known)}"
    if error["type"] == "missing":
        return f"{owner}.{key} is missing: add it"
    return f"{owner}.{key}: {error['msg'][0].lower()}{error['msg'][1:]}, got {error['input']!r}"


def _try(grafted: Grafted, like: Tensor) -> None:
    """Fuse something once, so that parts of other widths are found out here and not in training."""
    random = torch.Generator().manual_seed(0)
    cloud = torch.rand(1, 64, 3, generator=random).to(like)
    features = torch.rand(1, 64, grafted.joint.width, generator=random).to(like)
    mask = torch.ones(1, 1, dtype=torch.bool, device=like.device)
    with _quiet(grafted, like.device):
        try:
            fused = fuse(grafted.fusion, grafted.touch_encoder, cloud, features, cloud[:, None], mask)
            reason = f"it gives {tuple(fused.shape)} for {tuple(features.shape)}"
        except Exception as error:  # an instance of other widths fails in whatever way its layers do
            fused, reason = None, f"{type(error).__name__}: {_one_line(error)}"
    if fused is None or fused.shape != features.shape:
        raise UserError(
            f"the fusion {type(grafted.fusion).__name__} does not fit layer '{grafted.joint.at}' of "
            f"{grafted.joint.width} channels and its touch encoder: {reason}. Make it for these widths or name it"
        )


def _check_touches(points: Points, touches: Tensor, mask: Tensor) -> None:
    rows = points.shape[0]
    if touches.dim() != 4 or touches.shape[0] != rows or touches.shape[3] != 3 or touches.shape[2] == 0:
        raise UserError(
            f"touches are {tuple(touches.shape)}, not (b a m 3) with b = {rows} as the points and m at least 1"
        )
    if (touches.dtype, touches.device) != (points.dtype, points.device):
        raise UserError(
            f"touches are {touches.dtype} on {touches.device}, the points {points.dtype} on {points.device}: "
            f"give touches.to(points)"
        )
    if (mask.dtype, mask.device) != (torch.bool, touches.device) or mask.shape != touches.shape[:2]:
        raise UserError(
            f"mask is {mask.dtype} {tuple(mask.shape)} on {mask.device}, not torch.bool {tuple(touches.shape[:2])} on "
            f"{touches.device}, one for each touch"
        )


def _check_frame(points: Points, touches: Tensor, mask: Tensor) -> None:
    """Refuse rows whose touches are all far away, or not finite: in another unit or frame than the points."""
    cloud = points.detach().float()
    centre = cloud.mean(1, keepdim=True)
    radius = (cloud - centre).norm(dim=-1).amax(1)
    distance = (touches.detach().float().mean(2) - centre).norm(dim=-1)  # (b a)
    far = ~(distance <= FAR * radius[:, None])
    wrong = mask.any(1) & (far | ~mask).all(1)
    if wrong.any():
        row = int(wrong.nonzero()[0])
        raise UserError(
            f"row {row} of the batch: its touches are {float(distance[row][mask[row]].min()):.3g} or more from the "
            f"centre of a cloud of radius {float(radius[row]):.3g}: give points and touches in one frame and unit"
        )


def _argument(which: int | str, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
    if isinstance(which, str) and which in kwargs:
        return kwargs[which]
    if isinstance(which, int) and 0 <= which < len(args):
        return args[which]
    raise UserError(
        f"the points should be argument {which!r} of the network, which got {len(args)} by position and "
        f"{', '.join(kwargs) or 'none'} by keyword: hand them over there, or graft with another points="
    )


def _channel_axis(layout: PointsLayout) -> Literal[1, 2]:
    return 2 if layout == "bnc" else 1


def _to_bnc(output: Tensor, layout: Layout) -> Float[Tensor, "b n c"]:
    if layout == "bnc":
        return output
    return (output.squeeze(-1) if layout == "bcn1" else output).transpose(1, 2)


def _from_bnc(features: Float[Tensor, "b n c"], layout: Layout) -> Tensor:
    # Contiguous, as the layer's own output is: the code behind it may take views.
    if layout == "bnc":
        return features.contiguous()
    turned = features.transpose(1, 2).contiguous()
    return turned.unsqueeze(-1) if layout == "bcn1" else turned


def _check_output(joint: Joint, output: Any, points: Tensor) -> None:
    """Refuse what is not one feature for each point, in the joint's layout and width."""
    rows, count = points.shape[:2]
    expected = {
        "bnc": (rows, count, joint.width),
        "bcn": (rows, joint.width, count),
        "bcn1": (rows, joint.width, count, 1),
    }[joint.layout]
    if not isinstance(output, Tensor) or output.shape != expected:
        shape = tuple(output.shape) if isinstance(output, Tensor) else f"a {type(output).__name__}"
        raise UserError(
            f"layer '{joint.at}' gives {shape} for {rows} × {count} points, not one feature of {joint.width} channels "
            f"for each as '{joint.layout}': graft at a layer ahead of any sampling, and state the layout it has"
        )


def _probe(
    network: nn.Module,
    at: str,
    layout: Layout | None,
    points: int | str,
    points_layout: PointsLayout | None,
    probe: Sequence[int] | Tensor,
    arguments: Sequence[Any],
    keywords: Mapping[str, Any],
) -> Joint:
    """Run the network, twice where the layout is not stated, and look at what the layer gives."""
    layer = _layer(network, at)
    if isinstance(points, int) and not 0 <= points <= len(arguments):
        raise UserError(
            f"points={points} is no position beside {len(arguments)} others: give those before it in arguments="
        )
    like = _like(network)
    cloud = probe if isinstance(probe, Tensor) else _random_cloud(probe).to(like)
    if cloud.dim() != 3 or min(cloud.shape) == 0:
        raise UserError(f"the probe is {tuple(cloud.shape)}: points are (b n 3) or (b 3 n)")
    points_layout = points_layout or _points_layout(tuple(cloud.shape))
    axis = 3 - _channel_axis(points_layout)
    if cloud.shape[3 - axis] < 3:
        raise UserError(f"the probe is {tuple(cloud.shape)}, which is no '{points_layout}' of at least 3 channels")
    clouds = [cloud]
    if layout is None:
        cloud = cloud if len(cloud) > 1 else cloud.repeat(2, 1, 1)
        # Not the same points twice: distances of zero upset some networks.
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
    joint = Joint(at, layout, width, points, points_layout, cloud.shape[3 - axis])
    for one, output in zip(clouds, outputs, strict=True):
        _check_output(joint, output, one if axis == 1 else one.transpose(1, 2))
    return joint


def _layer(network: nn.Module, at: str) -> nn.Module:
    names = [name for name, _ in network.named_modules(remove_duplicate=False) if name]
    if at in names:
        return network.get_submodule(at)
    last = at.rpartition(".")[2]
    near = [name for name in names if last and name.rpartition(".")[2] == last]
    near = list(dict.fromkeys([*near, *get_close_matches(at, names, n=5)]))[:5]
    if near:
        remedy = f"did you mean {' or '.join(repr(name) for name in near)}?"
    else:
        remedy = f"it has {', '.join(names[:8]) or 'none'}{' …' if len(names) > 8 else ''}"
    raise UserError(f"the network {type(network).__name__} has no layer '{at}': {remedy}")


def _like(network: nn.Module) -> Tensor:
    """A tensor of the network's own type and device."""
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
    """What the layer gives in one run of the network, which is left as it was."""
    outputs: list[Any] = []
    handle = layer.register_forward_hook(lambda _layer, _args, output: outputs.append(output))
    try:
        with _quiet(network, _like(network).device):
            network(*args, **kwargs)
    except Exception as error:  # foreign code fails in whatever way it likes
        raise UserError(
            f"{type(network).__name__} cannot be run on points of {shape}: {type(error).__name__}: {_one_line(error)}. "
            f"Say with probe= which points it takes, with arguments= and keywords= what else it needs, and with "
            f"layout= what the layer gives if it takes no other number of points"
        ) from error
    finally:
        handle.remove()
    if len(outputs) != 1:
        raise UserError(
            f"layer '{at}' is called {len(outputs)} times in one pass, and a graft hears touch at one call: graft at a "
            f"layer that is called once (a compiled or scripted network calls none of its layers)"
        )
    if not isinstance(outputs[0], Tensor):
        inner = [f"'{at}.{name}'" for name, _ in layer.named_children()]
        remedy = f"a layer inside of it, such as {' or '.join(inner[:5])}" if inner else "another layer"
        raise UserError(f"layer '{at}' gives a {type(outputs[0]).__name__}, not a tensor: graft at {remedy}")
    return outputs[0]


@contextmanager
def _quiet(network: nn.Module, device: torch.device) -> Iterator[None]:
    """No gradients, `eval` mode, and the random state and the modes put back afterwards."""
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
    """Layout and width of a layer from its output for two numbers of points."""
    (n, more), (first, second) = counts, shapes
    shown = f"layer '{at}' gives {first} for {n} points and {second} for {more}"
    axes = range(1, min(len(first), len(second)))
    along = [axis for axis in axes if (first[axis], second[axis]) == (n, more)]
    moved = [axis for axis in axes if first[axis] != second[axis]]
    if len(along) > 1 or (along and moved != along):
        raise UserError(f"{shown}: its width cannot be told: state it with layout='bnc', 'bcn' or 'bcn1'")
    if not along and len(moved) == 1:
        raise UserError(f"{shown}: not as many points as entered, as behind a sampling: graft ahead of it")
    known: dict[tuple[int, int], tuple[Layout, int]] = {(3, 1): ("bnc", 2), (3, 2): ("bcn", 1), (4, 2): ("bcn1", 1)}
    found = known.get((len(first), along[0])) if along else None
    if found is None or (len(first) == 4 and first[3] != 1):
        raise UserError(f"{shown}: not one feature for each point, as (b n c), (b c n) or (b c n 1): graft elsewhere")
    return found[0], first[found[1]]


def _one_line(thing: object) -> str:
    return " ".join(str(thing).split())


class _CallableModule(ModuleType):
    """`pcsr.graft` names this file and its function alike: importing the file must not hide the function."""

    __call__ = staticmethod(graft)


sys.modules[__name__].__class__ = _CallableModule
