"""The reader of weights files into networks: the recipe in the card is checked, built, and filled with the weights."""

import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from pcsr.errors import PcsrWarning, UserError
from pcsr.network.build import build
from pcsr.network.card import check_parts, made_by, other_code
from pcsr.network.network import Network
from pcsr.network.outline import bounded, outline
from pcsr.network.save import tensors_hash
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe, check_card
from pcsr.weights.file import read_card, read_file, read_shapes
from pcsr.weights.fit import check_fit, fill


def load_weights(path: Path, registry: Registry) -> tuple[Network, Recipe, dict[str, Any]]:
    """A network ready for use (in `eval` mode), its recipe and its card.

    Of the recipe only the parts of the network must be installed. Those of the data and the training are as the card
    says.

    Raises:
        UserError: no weights file, one that was damaged or changed, a part that is not installed, or weights that
            don't fit the recipe. The message says what to do.

    Warns:
        PcsrWarning: the code of a part is not that with which they were made.
    """
    card = read_card(path)
    recipe = card.get("recipe")
    if not isinstance(recipe, dict):
        raise UserError(
            f"{path} holds no recipe, so nobody knows which network its weights are of: it is no weights file"
        )
    check_parts(path, card, registry)
    remedy = made_by(card, registry)
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
    """Explain any error within it: parts may raise whatever they like at options that were not meant for them.

    Raises:
        UserError: there was one.
    """
    try:
        yield
    except Exception as error:
        reason = "; ".join(str(error).splitlines())[:400] or type(error).__name__
        raise UserError(f"the network of {path} cannot be built here ({reason}). {remedy}") from error


def _checked(path: Path, recipe: dict[str, Any], registry: Registry, remedy: str) -> Recipe:
    """The recipe in a card."""
    with _building(path, remedy):
        return check_card(recipe, registry, "recipe in the weights")


def _build(path: Path, recipe: Recipe, registry: Registry, remedy: str) -> Network:
    """The network of a recipe, which is first compared with the file without memory for its weights.

    Raises:
        UserError: it cannot be built, or is not that of the file.
    """
    shapes = read_shapes(path)
    with _building(path, remedy):
        planned = outline(recipe, registry, len(shapes))
    if planned is not None:
        check_fit(planned, shapes, path, remedy)
    with _building(path, remedy), bounded(len(shapes)):
        return build(recipe, registry)
