"""Methods that an evaluation compares: the network of a recipe, and baselines."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pcsr.contracts import Baseline
from pcsr.data.sample import item_seed
from pcsr.errors import UserError
from pcsr.network.kinds import AnyNetwork
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe
from pcsr.recipe.pretrained import check_weights
from pcsr.tensors import CloudArray, Mesh
from pcsr.upsample import protocol, thread_limit, upsample_as


@dataclass(frozen=True)
class Method:
    """An upsampling method to compare."""

    name: str
    parameters: int
    upsample: Callable[[CloudArray, Sequence[CloudArray]], CloudArray] | None
    """Function of the sparse cloud and the touches, in one frame, that returns the dense cloud in that frame.

    `None`: `bound` is called instead.
    """
    bound: Baseline | None = None
    """Baseline that also gets the true surface. Its metrics bound those of any upsampling method."""
    threads: int = 1
    """Largest number of torch's threads."""
    protocol: str | None = None
    """Name of the way in which the network makes a cloud dense; `None` for baselines."""
    exchange_touches: bool = False
    """Whether it also upsamples each object with the touches of another one: networks that get touches as features,
    and not as points of the cloud or of the result."""


def methods(recipe: Recipe, network: AnyNetwork, registry: Registry) -> list[Method]:
    """Return the network of a recipe and its baselines as methods, the network first.

    Raises:
        UserError: the weights file that the recipe names has changed.
    """
    weights = check_weights(recipe, registry)
    trained = None if weights is None else weights.recipe
    own = Method(
        recipe.name,
        network.parameter_count,
        lambda points, touches: upsample_as(recipe, network, points, touches, trained=trained),
        threads=thread_limit(recipe, network),
        protocol=protocol(recipe, network),
        exchange_touches=network.fusion.uses_touch_features and not network.fusion.keeps_touched_points,
    )
    baselines = {name: registry.get("baseline", name)() for name in recipe.evaluate.baselines}
    return [own, *(_baseline_method(name, baseline, recipe) for name, baseline in baselines.items())]


def _baseline_method(name: str, baseline: Baseline, recipe: Recipe) -> Method:
    if baseline.needs_mesh:
        return Method(name, 0, None, baseline)
    rate, seed = recipe.data.rate, recipe.data_seed
    return Method(
        name, 0, lambda points, touches: upsampled(name, baseline, points, rate, None, np.random.default_rng([seed, 1]))
    )


def upsampled(
    name: str, baseline: Baseline, points: CloudArray, rate: int, mesh: Mesh | None, rng: np.random.Generator
) -> Float[np.ndarray, "_ 3"]:
    """Run a baseline, which may be a plugin's, on copies of the cloud and the mesh.

    Raises:
        UserError: the result is not `rate` times as many finite points.
    """
    dense = baseline.upsample(points.copy(), rate, mesh and (mesh[0].copy(), mesh[1].copy()), rng)
    wanted = (rate * len(points), 3)
    shape = getattr(dense, "shape", None)
    if not isinstance(dense, np.ndarray) or shape != wanted or dense.dtype.kind != "f" or not np.isfinite(dense).all():
        raise UserError(
            f"baseline '{name}' gave {type(dense).__name__} of shape {shape}, not finite points of shape {wanted}: "
            f"mend it, or leave it out of evaluate.baselines"
        )
    return dense


def bound_stream(seed: int, name: str) -> np.random.Generator:
    """Create the random generator of a baseline that samples the surface of an object.

    It is independent of the generator that sampled the true dense cloud.

    Args:
        seed: seed of the data.
        name: name of the object.
    """
    return np.random.default_rng([item_seed(seed, name), 1])
