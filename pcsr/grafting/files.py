"""Files of grafts: the weights of the network and of its tactile parts, and the options of these parts."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_args

from torch import Tensor, nn

from pcsr.errors import UserError
from pcsr.files import save_tensors
from pcsr.grafting.assembly import assemble
from pcsr.grafting.grafted import Grafted
from pcsr.grafting.injection_point import InjectionPoint, Layout, PointsLayout
from pcsr.grafting.probe import find_layer
from pcsr.plugins.registry import Registry
from pcsr.recipe.old_names import modern_part
from pcsr.weights.file import NONSENSE, card_text, fault, open_tensors, parse_card
from pcsr.weights.fit import fill

WIDEST = 10**6
"""Largest number of channels of a grafted layer."""


def save_graft(path: Path | str, grafted: Grafted, about: Mapping[str, Any] | None = None) -> None:
    """Write the weights of the network and of its tactile parts. The header holds the parts' options and `about`.

    Raises:
        UserError: a tactile part was given as an instance, which a file cannot describe, or `about` is not what
            JSON can write.

    Examples:
        >>> network = torch.nn.Sequential(torch.nn.Linear(3, 16), torch.nn.ReLU(), torch.nn.Linear(16, 3))
        >>> grafted = pcsr.graft(network, at="0", probe=(1, 32, 3))
        >>> pcsr.grafting.save_graft("grafted.safetensors", grafted, {"data": "mine"})
    """
    nameless = [kind for kind, spec in grafted.specs.items() if spec == "instance"]
    if nameless:
        raise UserError(
            f"the {nameless[0]} of this graft was given as an instance, so that a file cannot say how to build it: "
            f"register its class in a plugin and give its name, or save grafted.state_dict() yourself"
        )
    card = {"graft": {"injection_point": asdict(grafted.injection_point), **grafted.specs}, "about": dict(about or {})}
    try:
        header = json.dumps(card)
    except TypeError as error:
        raise UserError(f"about={about!r}: the header of a graft is what JSON can write, but {error}") from error
    # Cloned, since safetensors refuses weights that two layers share.
    tensors = {name: tensor.detach().clone() for name, tensor in grafted.state_dict().items()}
    save_tensors(Path(path), tensors, {"pcsr": header})


def load_graft(path: Path | str, network: nn.Module, registry: Registry | None = None) -> Grafted:
    """Load a graft that `save_graft` wrote onto `network`, whose weights are overwritten; returns it in `eval` mode.

    Raises:
        UserError: no file of `save_graft`, a part that is not installed, or another network; the message names
            the weights that differ, and nothing is changed.

    Examples:
        >>> network = torch.nn.Sequential(torch.nn.Linear(3, 16), torch.nn.ReLU(), torch.nn.Linear(16, 3))
        >>> grafted = pcsr.graft(network, at="0", probe=(1, 32, 3))
        >>> pcsr.grafting.save_graft("grafted.safetensors", grafted)
        >>> loaded = pcsr.grafting.load_graft("grafted.safetensors", network)
        >>> points, touches = torch.rand(1, 32, 3), torch.rand(1, 2, 8, 3)
        >>> torch.equal(loaded(points, touches=touches), grafted.eval()(points, touches=touches))
        True
    """
    path = Path(path)
    tensors, point, fusion, touch_encoder = _read(path)
    find_layer(network, point.at)
    grafted = assemble(network, point, fusion, touch_encoder, registry)
    fill(grafted, tensors, path, f"Build the {type(network).__name__} as it was when it was saved")
    return grafted.eval()


def _read(path: Path) -> tuple[dict[str, Tensor], InjectionPoint, Any, Any]:
    if not path.is_file():
        raise UserError(f"{path}: there is no such file of a graft")
    try:
        with open_tensors(path) as file:
            card = parse_card(card_text(file))["graft"]
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            return (
                tensors,
                _point(card),
                modern_part("fusion", card["fusion"]) if isinstance(card["fusion"], dict) else card["fusion"],
                modern_part("encoder", encoder) if isinstance(encoder := card["touch_encoder"], dict) else encoder,
            )
    except (OSError, *NONSENSE) as error:
        raise UserError(f"{path} is not a file of save_graft ({fault(error)}): save the graft again") from error


def _point(card: Any) -> InjectionPoint:
    """The injection point that a header describes; graft files of 0.1 call it "joint".

    Raises:
        ValueError: the header is invalid.
    """
    point = InjectionPoint(**card.get("injection_point", card.get("joint")))
    words = isinstance(point.at, str) and isinstance(point.points, int | str)
    layouts = point.layout in get_args(Layout) and point.points_layout in get_args(PointsLayout)
    numbers = all(isinstance(number, int) and 0 < number <= WIDEST for number in (point.width, point.channels))
    if not (words and layouts and numbers):
        raise ValueError("its injection point is none")
    return point
