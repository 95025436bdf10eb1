"""The graft that a recipe describes: its network is built from the file that the user named."""

import inspect
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

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
from pcsr.recipe.schema import Graft, Weights
from pcsr.weights.fit import check_fit


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
                f"{type(network).__name__} gives no cloud, (b rn 3) or (b 3 rn): name a class or function whose network "
                f"gives one"
            )
        if probed.rate != calling.rate:
            raise UserError(
                f"{type(network).__name__} makes {probed.rate} points of each, and the recipe asks for {calling.rate}: "
                f"set data.rate, or patches.rate for several passes"
            )
    parts = [_written(graft.fusion), graft.touch_encoder and _written(graft.touch_encoder)]
    fusion, encoder, specs = build_parts(point.width, *parts, registry)
    grafted = assemble(
        GraftedNetwork, network, fusion, encoder, point, specs, calling, frozen=graft.is_frozen
    )
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
    except Exception as error:  # foreign code may raise any error
        text = f"{type(error).__name__}: {one_line(error)}"
        if "cuda" in text.lower() and not torch.cuda.is_available():
            text += ". It needs a CUDA device, and there is none here"
        raise UserError(f"the network {graft.network} cannot be built with {graft.options}: {text}") from error
    if not isinstance(network, nn.Module):
        kind = "module" if inspect.ismodule(network) else type(network).__name__
        raise UserError(f"{graft.network} gives a {kind}, not a torch.nn.Module: name the class of the network")
    return network


def _written(spec: PartSpec) -> dict[str, Any]:
    return {"use": spec.use, **spec.options}


def load_state(network: nn.Module, weights: Weights) -> None:
    """Load the weights of a foreign network from a file of torch or safetensors. Nothing but tensors is unpickled.

    The file holds a `state_dict`, or a mapping with one, whose names may begin with `module.`.

    Raises:
        UserError: the file has changed, is none of weights, or is of another network.
    """
    path = Path(weights.use)
    if not path.is_file() or sha256(path) != weights.sha256:
        raise UserError(f"model.graft.weights: {path} has changed since the recipe was read: run it again")
    tensors = _state(_read(path), network)
    remedy = "Name weights of this network, and in model.graft.options the settings that they were trained with"
    check_fit(network, {name: tuple(tensor.shape) for name, tensor in tensors.items()}, path, remedy)
    network.load_state_dict(tensors)


def _read(path: Path) -> Any:
    try:
        if path.suffix == ".safetensors":
            from safetensors.torch import load_file

            return load_file(path)
        return torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # torch and safetensors raise errors of many kinds
        raise UserError(
            f"model.graft.weights: {path} is no file of tensors ({type(error).__name__}); pcsr unpickles nothing else: "
            f"write it anew with torch.save(network.state_dict(), …)"
        ) from error


def _state(found: Any, network: nn.Module) -> dict[str, Tensor]:
    """Return the state of a network in a checkpoint: the mapping of tensors that has most of the network's names."""
    wanted = network.state_dict().keys()
    mappings = [found, *(found.values() if isinstance(found, dict) else ())]
    states: list[dict[str, Tensor]] = [{}]
    for one in mappings:
        if isinstance(one, dict) and one and all(isinstance(value, Tensor) for value in one.values()):
            states += [one, {str(name).removeprefix("module."): value for name, value in one.items()}]
    return max(states, key=lambda state: len(wanted & state.keys()))
