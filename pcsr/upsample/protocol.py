"""Application of a recipe's network to one cloud: as a whole, or in patches, as the recipe says."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from pcsr.network.network import Network
from pcsr.recipe import Recipe
from pcsr.upsample.patchwise import AT_ONCE, upsample_patches
from pcsr.upsample.whole import upsample


def upsample_as(
    recipe: Recipe,
    network: Network,
    points: Float[np.ndarray, "n 3"],
    touches: Sequence[Float[np.ndarray, "m 3"]] = (),
) -> Float[np.ndarray, "rn 3"]:
    """Upsample one cloud at the recipe's rate, as in the evaluation of the recipe.

    Arguments and errors are those of `upsample` and `upsample_patches`.
    """
    if recipe.patches is None:
        return upsample(network, points, recipe.data.rate, touches)
    return upsample_patches(network, points, recipe.data.rate, touches, recipe.patches)


def points_at_once(recipe: Recipe) -> int:
    """Return the largest number of points in one batch of the network in `upsample_as`."""
    return recipe.data.points if recipe.patches is None else AT_ONCE * recipe.patches.points
