"""Loader of networks from weights files: builds the network of the recipe in the card, and loads the weights."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from pcsr.errors import PcsrWarning, UserError
from pcsr.network.build import build
from pcsr.network.card import check_parts, mismatch_remedy, other_code
from pcsr.network.network import Network
from pcsr.network.outline import bounded, outline
from pcsr.network.save import tensors_hash
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe, check_card
from pcsr.weights.file import read_card, read_file, read_shapes
from pcsr.weights.fit import check_fit, fill


def load_weights(path: Path, registry: Registry) -> tuple[Network, Recipe, dict[str, Any]]:
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
        raise UserError(f"{path} holds no recipe, so its network is unknown: it is no weights file of pcsr")
    check_parts(path, card, registry)
    remedy = mismatch_remedy(card, registry)
    checked = _checked(path, recipe, registry, remedy)
    origin = other_code(checked, card, registry)
    if origin:
        warnings.warn(f"the weights {path} were {origin}: results may differ", PcsrWarning, stacklevel=2)
        remedy = f"They were {origin}: hand in the code that made them, or train again"
    network = _build(path, checked, registry, remedy)
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


def _build(path: Path, recipe: Recipe, registry: Registry, remedy: str) -> Network:
    """Build the network of a recipe after comparing its outline with the file, which needs no memory for weights.

    Raises:
        UserError: the network cannot be built, or does not fit the file.
    """
    shapes = read_shapes(path)
    with _building(path, remedy):
        planned = outline(recipe, registry, len(shapes))
    if planned is not None:
        check_fit(planned, shapes, path, remedy)
    with _building(path, remedy), bounded(len(shapes)):
        return build(recipe, registry)
