"""Files of grafts: the weights of the network and of its tactile parts, and the options of these parts."""

import json
import textwrap
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, get_args

from safetensors import SafetensorError, safe_open
from torch import Tensor, nn

from pcsr.errors import UserError
from pcsr.files import save_tensors
from pcsr.grafting.assembly import assemble
from pcsr.grafting.grafted import Grafted
from pcsr.grafting.joint import Joint, Layout, PointsLayout
from pcsr.grafting.probe import find_layer
from pcsr.plugins.registry import Registry

WIDEST = 10**6
"""Largest number of channels of a grafted layer."""


def save_graft(path: Path | str, grafted: Grafted, about: Mapping[str, Any] | None = None) -> None:
    """Write the weights of the network and of its tactile parts. The header holds the parts' options and `about`.

    Raises:
        UserError: a tactile part was given as an instance, which a file cannot describe, or JSON cannot represent
            `about`.
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
    # Cloned, since safetensors refuses weights that two layers share.
    tensors = {name: tensor.detach().clone() for name, tensor in grafted.state_dict().items()}
    save_tensors(Path(path), tensors, {"pcsr": header})


def load_graft(path: Path | str, network: nn.Module, registry: Registry | None = None) -> Grafted:
    """Load a graft that `save_graft` wrote onto `network`, whose weights are overwritten; returns it in `eval` mode.

    Raises:
        UserError: not a file of `save_graft`, a part that is not installed, or another network. The message names the
            weights that differ, and nothing is changed.
    """
    path = Path(path)
    tensors, joint, fusion, touch_encoder = _read(path)
    find_layer(network, joint.at)
    grafted = assemble(network, joint, fusion, touch_encoder, registry)
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


def _read(path: Path) -> tuple[dict[str, Tensor], Joint, Any, Any]:
    if not path.is_file():
        raise UserError(f"{path}: there is no such file of a graft")
    try:
        with safe_open(path, "pt") as file:
            card = json.loads((file.metadata() or {})["pcsr"])["graft"]
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            return tensors, _joint(card["joint"]), card["fusion"], card["touch_encoder"]
    # An invalid header raises errors of safetensors, json or torch.
    except (SafetensorError, OSError, LookupError, TypeError, ValueError, AttributeError, RuntimeError) as error:
        reason = textwrap.shorten(str(error), 200)
        raise UserError(
            f"{path} is not a file of save_graft ({type(error).__name__}: {reason}): save the graft again"
        ) from error


def _joint(values: Any) -> Joint:
    """Read the joint from a header.

    Raises:
        ValueError: the header is invalid.
    """
    joint = Joint(**values)
    names = isinstance(joint.at, str) and isinstance(joint.points, int | str)
    layouts = joint.layout in get_args(Layout) and joint.points_layout in get_args(PointsLayout)
    numbers = all(isinstance(number, int) and 0 < number <= WIDEST for number in (joint.width, joint.channels))
    if not (names and layouts and numbers):
        raise ValueError("its joint is invalid")
    return joint
