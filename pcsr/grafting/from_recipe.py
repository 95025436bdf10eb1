"""The graft that a recipe describes: its network is built from the file that the user named."""

from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load_file
from torch import nn

from pcsr.errors import PcsrError, UserError
from pcsr.files import sha256
from pcsr.grafting.assembly import assemble
from pcsr.grafting.calling import Calling
from pcsr.grafting.grafted_network import GraftedNetwork
from pcsr.grafting.injection_point import InjectionPoint
from pcsr.grafting.observation import one_line, tensor_like
from pcsr.grafting.parts import build_parts, try_parts
from pcsr.grafting.probe import Question, probe_layer
from pcsr.plugins.guard import guarded
from pcsr.plugins.networks import find_network
from pcsr.plugins.registry import Registry
from pcsr.recipe import PartSpec, Recipe
from pcsr.recipe.graft_section import Graft
from pcsr.recipe.train_section import Weights
from pcsr.validation_messages import shown
from pcsr.weights.fit import fill


def build_graft(recipe: Recipe, graft: Graft, registry: Registry, point: InjectionPoint | None) -> GraftedNetwork:
    """Build the graft of a recipe; the network has the weights that its class gives it.

    Args:
        recipe: recipe of the network; its number of points and its rate are those of the probe.
        graft: its graft.
        registry: installed parts, and the file of the network.
        point: the layer, if it is known; then the network is not run.

    Raises:
        UserError: the network cannot be built or run, has no such layer or another rate, or the parts do not fit it.
    """
    network = foreign_network(graft, registry)
    calling = Calling(recipe.network_points, recipe.network_rate, graft.arguments, graft.keywords)
    known = point is not None
    if point is None:
        question = Question(graft.at, graft.layout, graft.points, graft.arguments, graft.keywords)
        point, probed = probe_layer(network, question, calling.count, graft.points_layout)
        if probed.rate is None:
            raise UserError(
                f"{type(network).__name__} gives no cloud, (b rn 3) or (b 3 rn): name a class or function "
                f"whose network gives one"
            )
        if probed.rate != calling.rate:
            raise UserError(
                f"{type(network).__name__} makes {probed.rate} points of each, and the recipe asks for {calling.rate}: "
                f"set data.rate, or patches.rate for several passes"
            )
    touch_encoder = None if graft.touch_encoder is None else _written(graft.touch_encoder)
    fusion, encoder, specs = build_parts(point.width, _written(graft.fusion), touch_encoder, registry)
    grafted = assemble(GraftedNetwork, network, fusion, encoder, point, specs, calling, frozen=graft.is_frozen)
    if not known:
        try_parts(grafted, tensor_like(network))
    return grafted


def foreign_network(graft: Graft, registry: Registry) -> nn.Module:
    """Build the network of a graft.

    Raises:
        UserError: its class or function raises an error, or gives no `torch.nn.Module`.
    """
    _, made_by = find_network(registry, graft.network)
    try:
        with guarded(f"the network {graft.network}"):
            network = made_by(**graft.options)
    except PcsrError:
        raise
    except (Exception, SystemExit) as error:  # foreign code may raise any error
        text = f"{type(error).__name__}: {one_line(error)}"
        if "cuda" in text.lower() and not torch.cuda.is_available():
            text += ". It needs a CUDA device, and there is none here"
        raise UserError(f"the network {graft.network} cannot be built with {graft.options}: {text}") from error
    if not isinstance(network, nn.Module):
        raise UserError(f"{graft.network} gives {shown(network)}, not a torch.nn.Module: name the class of the network")
    return network


def _written(spec: PartSpec) -> dict[str, Any]:
    return {"use": spec.use, **spec.options}


def load_state(network: nn.Module, weights: Weights) -> None:
    """Load the weights of a foreign network from a safetensors file. Nothing is unpickled.

    Raises:
        UserError: the file has changed, is no safetensors file, or is of another network.
    """
    path = Path(weights.use)
    if not path.is_file() or sha256(path) != weights.sha256:
        raise UserError(f"model.graft.weights: {path} has changed since the recipe was read: run it again")
    try:
        tensors = {name.removeprefix("module."): tensor for name, tensor in load_file(path).items()}
    except (OSError, SafetensorError, ValueError) as error:
        raise UserError(
            f"model.graft.weights: {path} is no safetensors file, and pcsr unpickles nothing: convert it with "
            f"safetensors.torch.save_file(state_dict, …), or load it in the function that returns the network"
        ) from error
    remedy = "Name weights of this network, and in model.graft.options the settings that they were trained with"
    fill(network, tensors, path, remedy)
