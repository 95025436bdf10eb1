"""Loader of networks from weights files: builds the network of the recipe in the card, and loads the weights."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from pcsr.errors import PcsrWarning, UserError
from pcsr.grafting.description import point_of
from pcsr.grafting.injection_point import InjectionPoint
from pcsr.network.build import build
from pcsr.network.card import check_parts, mismatch_remedy, other_code
from pcsr.network.kinds import AnyNetwork
from pcsr.network.outline import bounded, outline
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe, check_card
from pcsr.recipe.schema import GraftedModel
from pcsr.weights.file import NONSENSE, read_card, read_file, read_shapes, tensors_hash
from pcsr.weights.fit import check_fit, fill

SAVE_AGAIN = "Save the graft again, and give save_graft the options of the network's class, or the builder"
"""Remedy for a graft whose network cannot be built."""


def load_weights(path: Path, registry: Registry) -> tuple[AnyNetwork, Recipe, dict[str, Any]]:
    """Load a network from a weights file.

    Only the parts of the network must be installed. Those of the data and the training are not checked.

    Returns:
        The network in `eval` mode, its recipe, and the card of the file.

    Raises:
        UserError: the file is no weights file, is damaged or changed, needs a part that is not installed, or does not
            fit its recipe.

    Warns:
        PcsrWarning: the code of a part has changed since training.
    """
    card = read_card(path)
    recipe = card.get("recipe")
    if not isinstance(recipe, dict):
        remedy = "it is no weights file of pcsr"
        if "graft" in card:
            remedy = "load the graft onto its network with pcsr.grafting.load_graft"
        raise UserError(f"{path} holds no recipe, so its network is unknown: {remedy}")
    check_parts(path, card, registry)
    saved = "graft" in card and "fingerprint" not in card  # by `save_graft`
    remedy = SAVE_AGAIN if saved else mismatch_remedy(card, registry)
    checked = _checked(path, recipe, registry, remedy)
    origin = other_code(checked, card, registry)
    if origin:
        warnings.warn(f"the weights {path} were {origin}: results may differ", PcsrWarning, stacklevel=2)
        remedy = f"They were {origin}: hand in the code that made them, or train again"
    network = _build(path, checked, registry, remedy, _point(path, checked, card))
    tensors, _ = read_file(path)
    if "sha256" in card and card["sha256"] != tensors_hash(tensors):
        raise UserError(f"{path} has changed since it was written (its hash differs): get it again")
    fill(network, tensors, path, remedy)
    for name, tensor in network.state_dict().items():
        if not torch.isfinite(tensor).all():
            raise UserError(f"{path} is damaged: its weights '{name}' are not all finite: get it again, or train again")
    return network.eval(), checked, card


@contextmanager
def _building(path: Path, remedy: str) -> Iterator[None]:
    """Turn any error into a user error: constructors of parts may raise any error for unexpected options.

    Raises:
        UserError: building the network fails within the context.
    """
    try:
        yield
    except Exception as error:
        reason = "; ".join(str(error).splitlines())[:400] or type(error).__name__
        raise UserError(f"the network of {path} cannot be built here ({reason}). {remedy}") from error


def _checked(path: Path, recipe: dict[str, Any], registry: Registry, remedy: str) -> Recipe:
    """Check the recipe of a card."""
    with _building(path, remedy):
        return check_card(recipe, registry, "recipe in the weights")


def _point(path: Path, recipe: Recipe, card: dict[str, Any]) -> InjectionPoint | None:
    """Return the layer of a graft, which was found when it was made; None for a network of parts.

    Raises:
        UserError: the card does not describe it.
    """
    if not isinstance(recipe.model, GraftedModel):
        return None
    try:
        point = point_of(card["graft"])
    except NONSENSE as error:
        raise UserError(f"{path} does not describe the layer of its graft: save it again, or train again") from error
    graft = recipe.model.graft
    if (point.at, point.points, point.channels) != (graft.at, graft.points, 3):
        raise UserError(
            f"{path} is a graft at '{point.at}' with {point.channels} channels of a point, which its recipe does not "
            f"describe: load it with pcsr.grafting.load_graft"
        )
    return point


def _build(path: Path, recipe: Recipe, registry: Registry, remedy: str, point: InjectionPoint | None) -> AnyNetwork:
    """Build the network of a recipe after comparing its outline with the file, which needs no memory for weights.

    Raises:
        UserError: the network cannot be built, or does not fit the file.
    """
    shapes = read_shapes(path)
    with _building(path, remedy):
        planned = outline(recipe, registry, len(shapes), point)
    if planned is not None:
        check_fit(planned, shapes, path, remedy)
    with _building(path, remedy), bounded(len(shapes)):
        return build(recipe, registry, point)
