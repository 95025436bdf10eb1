"""Upsampling of one cloud as a recipe is evaluated: as `pcsr upsample` does it, or as the field does."""

import warnings
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from pcsr.contracts import Trait
from pcsr.errors import PcsrWarning
from pcsr.network.kinds import AnyNetwork
from pcsr.recipe import Recipe
from pcsr.threads import thread_count
from pcsr.upsample.candidates import Networked
from pcsr.upsample.dense import densify
from pcsr.upsample.patchwise import AT_ONCE, upsample_patches
from pcsr.upsample.whole import upsample

IN_USE = "as pcsr upsample"
"""Name of the protocol by which `pcsr upsample` and `Model.upsample` make a cloud dense."""
WHOLE = "whole cloud in one pass, as TAPSR"
"""Name of the protocol by which a network gets the whole cloud."""


def upsample_as(
    recipe: Recipe,
    network: AnyNetwork,
    points: Float[np.ndarray, "n 3"],
    touches: Sequence[Float[np.ndarray, "m 3"]] = (),
    *,
    trained: Recipe | None = None,
) -> Float[np.ndarray, "rn 3"]:
    """Upsample one cloud at the recipe's rate, as in the evaluation of the recipe; `protocol` names the way.

    Args:
        recipe: the rate, and patches if there are any.
        network: in `eval` mode.
        points: the sparse cloud, in any frame and unit.
        touches: touched points in the frame and unit of `points`, the same number for each touch. Those of unseen
            regions are added without a warning.
        trained: recipe of the network's training, if that is another one.

    Returns:
        The dense cloud in the frame and unit of `points`, float64.

    Raises:
        UserError: a cloud that is empty, not finite or too small, or touches that a whole cloud cannot have.
        RunError: the network generated a coordinate that is not finite.
    """
    if not _in_use(recipe, network):
        return upsample_plainly(recipe, network, points, touches)
    cloud = np.asarray(points, np.float64)
    touched = [np.asarray(touch, np.float64) for touch in touches]
    source = Networked.of(network, recipe if trained is None else trained)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PcsrWarning)
        new = densify(cloud, recipe.data.rate * len(cloud), source, touches=touched)
    return np.concatenate([cloud, new.points])


def upsample_plainly(
    recipe: Recipe,
    network: AnyNetwork,
    points: Float[np.ndarray, "n 3"],
    touches: Sequence[Float[np.ndarray, "m 3"]] = (),
) -> Float[np.ndarray, "rn 3"]:
    """Upsample one cloud with the network alone: as a whole, or in patches if the recipe has some.

    Training is validated in this way, which is the cheapest. Arguments and errors are those of `upsample` and
    `upsample_patches`.
    """
    if recipe.patches is None:
        return upsample(network, points, recipe.data.rate, touches)
    return upsample_patches(network, points, recipe.data.rate, touches, recipe.patches)


def protocol(recipe: Recipe, network: AnyNetwork) -> str:
    """Return the name of the way in which `upsample_as` makes a cloud dense."""
    if recipe.patches is not None:
        return f"by patches of {recipe.patches.points} points at {recipe.patches.rate}x, as PU-Net"
    return IN_USE if _in_use(recipe, network) else WHOLE


def thread_limit(recipe: Recipe, network: AnyNetwork) -> int:
    """Return the largest number of torch's threads that `upsample_as` uses."""
    if _in_use(recipe, network):
        return 1
    return thread_count(points_at_once(recipe), network.parameter_count)


def points_at_once(recipe: Recipe) -> int:
    """Return the largest number of points in one batch of the network in `upsample_plainly`."""
    return recipe.data.points if recipe.patches is None else AT_ONCE * recipe.patches.points


def _in_use(recipe: Recipe, network: AnyNetwork) -> bool:
    """Return whether the network can make clouds of any number of points dense, and its recipe has no protocol."""
    return recipe.patches is None and Trait.ANY_RATE in network.upsampler.traits
