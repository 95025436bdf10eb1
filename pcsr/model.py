"""pcsr from Python: load a model, upsample clouds of any kind and size."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float

from pcsr.clouds.convert import convert
from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.geometry.checks import check_cloud, check_frame
from pcsr.geometry.magnitude import exponent, scaled
from pcsr.network.load import load_weights
from pcsr.network.network import Network
from pcsr.plugins.loading import load_plugins, warn_of_failures
from pcsr.recipe import Recipe
from pcsr.upsample.candidates import Candidates, Midpoints, Networked, Stored
from pcsr.upsample.dense import densify
from pcsr.weights import DEFAULT
from pcsr.weights.find import find
from pcsr.workers import worker_pool

INTERPOLATION = "midpoint"
"""The name of what needs no weights."""
MOST_DISTANCE = 0.5
"""The largest distance of a touch from the cloud, in diameters of the cloud."""
MOST_SIZE = 2.0
"""The largest diameter of a touch, in diameters of the cloud."""
RATES = (1.1, 64.0)

TouchesLike = str | Path | Sequence[Any]


@dataclass(frozen=True)
class Model:
    """What makes clouds dense: a network with its weights, or interpolation.

    Examples:
        >>> model = pcsr.load("tapsr")
        >>> model.recipe.data.rate
        16
        >>> model.card["recipe"]["model"]["fusion"]["use"]
        'iterative'
    """

    name: str
    network: Network | None
    """In `eval` mode; None for interpolation."""
    recipe: Recipe | None
    card: dict[str, Any]
    """What the weights' file says of them."""
    path: Path | None
    plugins: tuple[Path, ...]

    def upsample(
        self,
        points: Any,
        touches: TouchesLike = (),
        rate: float | int | None = None,
        *,
        count: int | None = None,
        keep: bool = True,
        jobs: int = 1,
        scheduler: str | None = None,
        advance: Callable[[int, int], None] = lambda done, total: None,
    ) -> Any:
        """Make a cloud dense, whatever its size.

        Args:
            points: (n, 3), in any frame and unit: a numpy array, a torch tensor, a trimesh or an Open3D cloud, or a
                `pcsr.clouds.cloud.Cloud`.
            touches: in the frame and unit of `points`: arrays (m, 3), `Touch` records, or a folder with a recording.
            rate: points that come out for each that goes in, 1.1 to 64; 4 if neither it nor `count` is given.
            count: how many come out, instead of a rate.
            keep: the old points come first, and new ones follow; otherwise all are new.
            jobs: processes.
            scheduler: address of a Dask scheduler whose workers do the work.
            advance: called with the points that are done and all of them.

        Returns:
            A cloud of the same kind, in the same frame and unit. Colours, normals and other columns of the new points
            are interpolated from their neighbours.

        Raises:
            UserError: points that are too few, not finite or on one spot; touches far away; an impossible number.

        Warns:
            PcsrWarning: something was touched where the cloud has no points.

        Examples:
            >>> cloud = np.random.default_rng(0).normal(size=(100, 3))
            >>> dense = pcsr.load("midpoint").upsample(cloud, rate=2.5)
            >>> dense.shape
            (250, 3)
            >>> bool((dense[:100] == cloud).all())
            True
        """
        given = convert(points)
        cloud = given.cloud.points
        check_cloud(cloud)
        wanted = _count(len(cloud), rate, count)
        power = exponent([cloud])
        cloud = scaled(cloud, -power)
        touched = _touched(touches, cloud, power)
        with worker_pool(jobs, scheduler) as workers:
            source = self._candidates(alone=workers.executor is None)
            new = densify(cloud, wanted, source, touches=touched, keep=keep, pool=workers, advance=advance)
        return given.restore(given.cloud.with_new(scaled(new, power), keep=keep))

    def _candidates(self, *, alone: bool) -> Candidates:
        if self.network is None or self.recipe is None:
            return Midpoints()
        if alone:
            return Networked.of(self.network, self.recipe)
        if self.path is None:
            raise UserError("a model that is in memory alone cannot be sent to other processes: take one process")
        return Stored(self.path.resolve(), self.plugins, self.recipe.network_points, self.recipe.network_rate)


def load(
    model: str | Path | None = None, *, plugins: Sequence[str | Path] = (), device: str | torch.device = "cpu"
) -> Model:
    """A model ready for use.

    Args:
        model: a name (`frames`, `tapsr`, `pu-transformer`, or `midpoint` for interpolation), a run folder, a weights
            file, or `org/name` on the Hugging Face hub (extra `[hub]`); the default weights if not given.
        plugins: Python files with parts that the weights need.
        device: where to compute.

    Raises:
        UserError: there is no such model, its file is damaged, or a part that it needs is not installed.

    Examples:
        >>> cloud = np.random.default_rng(0).normal(size=(64, 3))
        >>> pcsr.load().upsample(cloud, rate=2).shape
        (128, 3)
        >>> pcsr.load("midpoint").name
        'midpoint'
    """
    files = tuple(Path(file) for file in plugins)
    name = DEFAULT if model is None else str(model)
    if not name:
        raise UserError("the model is an empty text: give a name, a run folder or a weights file")
    if name == INTERPOLATION:
        return Model(name, None, None, {}, None, files)
    path = find(name, paths_first=True, hub=True, others=[INTERPOLATION])
    registry = load_plugins(files)
    warn_of_failures(registry)
    network, recipe, card = load_weights(path, registry)
    try:
        network.to(device)
    except (RuntimeError, AssertionError) as error:
        raise UserError(f"device '{device}' cannot be used: {str(error).splitlines()[0]}") from error
    return Model(name, network, recipe, card, path, files)


def _count(n: int, rate: float | int | None, count: int | None) -> int:
    if rate is not None and count is not None:
        raise UserError(
            f"rate {rate:g} and count {count} say the same thing twice: give one of them (--rate, --points)"
        )
    if count is not None:
        if count < 1:
            raise UserError(f"count is {count}: at least one point must come out")
        if count > RATES[1] * n:
            raise UserError(f"count is {count}, more than {RATES[1]:g} times the cloud's {n} points: ask for fewer")
        return count
    rate = 4.0 if rate is None else float(rate)
    if not RATES[0] <= rate <= RATES[1]:
        raise UserError(
            f"rate is {rate:g}: it must be {RATES[0]:g} to {RATES[1]:g}; for other numbers give a count (--points)"
        )
    return round(rate * n)


def _touched(touches: TouchesLike, cloud: Float[np.ndarray, "n 3"], power: int) -> list[Float[np.ndarray, "_ 3"]]:
    """The points of each touch, in the frame of the cloud, which was divided by a power of two."""
    if isinstance(touches, str | Path):
        from pcsr.recorded import read  # here, as its layouts take long to load and few have a recording

        touches = read(Path(touches)).touches
    touched = [
        np.asarray(touch.points if isinstance(touch, Touch) else convert(touch).cloud.points) for touch in touches
    ]
    if not touched:
        return []
    middle = cloud.mean(0)
    radius = float(np.linalg.norm(cloud - middle, axis=1).max())
    for number, touch in enumerate(touched):
        touch = touched[number] = scaled(touch, -power)
        if len(touch) == 0 or not np.isfinite(touch).all():
            raise UserError(f"touch {number} has {len(touch)} points, which must be some and finite")
        with np.errstate(over="ignore", invalid="ignore"):  # a touch in a unit that is far too small
            size = 2 * float(np.linalg.norm(touch - touch.mean(0), axis=1).max())
            away = float(np.linalg.norm(touch - middle, axis=1).min()) - radius
        check_frame(
            f"touch {number}",
            "the cloud",
            distance=away,
            extent=2 * radius,
            most_distance=MOST_DISTANCE,
            size=size,
            most_size=MOST_SIZE,
            power=power,
        )
    return touched
