"""Files of grafts: the weights of the network and of its tactile parts, and what is needed to build them again."""

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from torch import Tensor, nn

from pcsr.errors import UserError
from pcsr.files import save_tensors
from pcsr.grafting.assembly import assemble
from pcsr.grafting.description import described, named_parts, point_of
from pcsr.grafting.grafted import Grafted
from pcsr.grafting.injection_point import InjectionPoint
from pcsr.grafting.parts import build_parts
from pcsr.grafting.probe import find_layer
from pcsr.plugins.loading import check_loaded, load_plugins, plugin_paths
from pcsr.plugins.networks import makes_network
from pcsr.plugins.registry import Registry
from pcsr.recipe.part_keys import NETWORK
from pcsr.weights.file import NONSENSE, card_text, fault, open_tensors, parse_card, tensors_hash
from pcsr.weights.fit import fill

TOUCHES = (16, 512)
"""Largest number of touches of a cloud, and number of points of a touch, where the training is not known."""


def save_graft(
    path: Path | str,
    grafted: Grafted,
    about: Mapping[str, Any] | None = None,
    *,
    options: Mapping[str, Any] | None = None,
    touches: tuple[int, int] = TOUCHES,
    builder: Callable[..., nn.Module] | None = None,
) -> None:
    """Write the weights of the network and of its tactile parts, with a description of the graft in the header.

    `load_graft` loads the file, and so does `pcsr.load` if the network's output is a cloud and its class or `builder`
    is given in a plugin file.

    Args:
        path: the file; it is written completely or not at all.
        grafted: the graft.
        about: plain data for the header.
        options: keyword arguments of the constructor of the network's class, or of `builder`.
        touches: largest number of touches of a cloud in training, 0 to 16, and number of points of each. `pcsr.load`
            gives the network no more.
        builder: function of a file that builds the network, for classes whose arguments JSON cannot write. It must be
            annotated as returning a `torch.nn.Module`.

    Raises:
        UserError: a tactile part was given as an instance, which a file cannot describe; `about` or `options` are not
            what JSON can write; or `builder` is not annotated.

    Examples:
        >>> network = torch.nn.Sequential(torch.nn.Linear(3, 16), torch.nn.ReLU(), torch.nn.Linear(16, 3))
        >>> grafted = pcsr.graft(network, at="0")
        >>> pcsr.grafting.save_graft("grafted.safetensors", grafted, {"data": "mine"})
    """
    nameless = [kind for kind, spec in grafted.specs.items() if spec == "instance"]
    if nameless:
        raise UserError(
            f"the {nameless[0]} of this graft was given as an instance, so that a file cannot say how to build it: "
            f"register its class in a plugin and give its name, or save grafted.state_dict() yourself"
        )
    if not (0 <= touches[0] <= 16 and touches[1] >= 1):
        raise UserError(f"touches={touches}: give the largest number of touches, 0 to 16, and the points of each")
    # Cloned, since safetensors refuses weights that two layers share.
    tensors = {name: tensor.detach().clone() for name, tensor in grafted.state_dict().items()}
    card: dict[str, Any] = {"graft": described(grafted), "about": dict(about or {}), "sha256": tensors_hash(tensors)}
    recipe = _recipe(grafted, type(grafted.network) if builder is None else builder, dict(options or {}), *touches)
    if recipe is not None:
        card["recipe"] = recipe
    try:
        header = json.dumps(card, allow_nan=False)
    except (TypeError, ValueError) as error:  # ValueError: a number that is not finite, or a list in itself
        raise UserError(
            f"about={about!r}, options={options!r}: the header of a graft is what JSON can write, but {error}"
        ) from error
    save_tensors(Path(path), tensors, {"pcsr": header})


def _recipe(
    grafted: Grafted, builder: Callable[..., nn.Module], options: dict[str, Any], touches: int, touch_points: int
) -> dict[str, Any] | None:
    """Return a recipe with which `pcsr.load` can use the graft; None if the network is no upsampler of a file.

    Raises:
        UserError: the builder is neither a class nor an annotated function.
    """
    calling = grafted.calling
    if not isinstance(builder, type) and not makes_network(builder):
        name = _name(builder)
        raise UserError(f"builder '{name}' is not annotated: write `def {name}(…) -> torch.nn.Module:`")
    code = getattr(
        inspect.unwrap(getattr(builder, "forward", builder)), "__code__", None
    )  # that of a class may be one of a notebook
    network = f"{Path(code.co_filename).name if code else ''}:{_name(builder)}"
    if (
        calling is None
        or calling.rate is None
        or not NETWORK.fullmatch(network)
        or builder.__module__.startswith("torch.")
    ):
        return None
    try:
        json.dumps([*calling.arguments, calling.keywords])
    except TypeError:
        return None
    point = grafted.injection_point
    graft = {
        "network": network,
        "options": options,
        "at": point.at,
        **grafted.specs,
        "points": point.points,
        "arguments": list(calling.arguments),
        "keywords": dict(calling.keywords),
    }
    touch = {"use": "digit", "points": touch_points}
    data = {"points": calling.count, "rate": calling.rate, "touches": touches, "touch": touch}
    return {"name": "graft", "data": data, "model": {"graft": graft}}


def _name(builder: Callable[..., nn.Module]) -> str:
    return getattr(builder, "__qualname__", "network")


def load_graft(
    path: Path | str, network: nn.Module, registry: Registry | None = None, *, plugins: Sequence[str | Path] = ()
) -> Grafted:
    """Load a graft onto `network`, whose weights are overwritten; returns it in `eval` mode.

    Args:
        path: file of `save_graft`, or weights of a run whose recipe has a graft.
        network: the network as it was when the graft was saved, with any weights.
        registry: of parts, instead of the installed ones and those of `plugins`.
        plugins: Python files with further fusions and encoders.

    Raises:
        UserError: the file has no graft, needs a part that is not installed, or is of another network; the message
            names the weights that differ, and nothing is changed.

    Examples:
        >>> network = torch.nn.Sequential(torch.nn.Linear(3, 16), torch.nn.ReLU(), torch.nn.Linear(16, 3))
        >>> grafted = pcsr.graft(network, at="0")
        >>> pcsr.grafting.save_graft("grafted.safetensors", grafted)
        >>> loaded = pcsr.grafting.load_graft("grafted.safetensors", network)
        >>> points, touches = torch.rand(1, 32, 3), torch.rand(1, 2, 8, 3)
        >>> torch.equal(loaded(points, touches=touches), grafted.eval()(points, touches=touches))
        True
    """
    path = Path(path)
    tensors, point, parts = _read(path)
    find_layer(network, point.at)
    if registry is None:
        registry = load_plugins(plugin_paths(plugins))
        check_loaded(registry)
    grafted = assemble(Grafted, network, *_built(point, parts, registry), frozen=True)
    fill(grafted, tensors, path, f"Build the {type(network).__name__} as it was when it was saved")
    return grafted.eval()


def _built(point: InjectionPoint, parts: tuple[Any, Any], registry: Registry) -> tuple[Any, ...]:
    fusion, encoder, specs = build_parts(point.width, *parts, registry)
    return fusion, encoder, point, specs


def _read(path: Path) -> tuple[dict[str, Tensor], InjectionPoint, tuple[Any, Any]]:
    if not path.is_file():
        raise UserError(f"{path}: there is no such file of a graft")
    try:
        with open_tensors(path) as file:
            card = parse_card(card_text(file))["graft"]
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            return tensors, point_of(card), named_parts(card)
    except (OSError, *NONSENSE) as error:
        raise UserError(f"{path} is not a file of save_graft ({fault(error)}): save the graft again") from error
