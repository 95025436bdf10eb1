"""Models for inference: loading of weights, and upsampling of clouds of any kind and size."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float, Int
from scipy.spatial import cKDTree

from pcsr.clouds.cloud import MADE, TOUCHED, Cloud
from pcsr.clouds.convert import convert
from pcsr.clouds.faults import Bad, ScreenedCloud, screen
from pcsr.clouds.pose_error import PoseError
from pcsr.errors import UserError
from pcsr.geometry.magnitude import exponent, scaled
from pcsr.network.kinds import AnyNetwork
from pcsr.network.load import load_weights
from pcsr.plugins.loading import check_loaded, load_plugins, plugin_paths
from pcsr.recipe import Recipe
from pcsr.stages import TwoStages
from pcsr.touches import GivenTouches, TouchesLike
from pcsr.uncertainty.upsampled import given_errors, upsampled_errors
from pcsr.upsample.candidates import Candidates, Midpoints, Networked, Stored
from pcsr.upsample.denoised_cloud import denoise_cloud
from pcsr.upsample.dense import densify
from pcsr.weights import DEFAULT
from pcsr.weights.find import find
from pcsr.workers import worker_pool

INTERPOLATION = "midpoint"
"""Name of the model that interpolates and needs no weights."""
FIELDS = ("source", "error")
"""Columns that the result can have on request."""
RATES = (1.1, 64.0)
"""Smallest and largest rate."""


@dataclass(frozen=True)
class Model:
    """Upsampling model: a network with its weights, or interpolation.

    Examples:
        >>> model = pcsr.load("tapsr")
        >>> model.recipe.data.rate
        16
        >>> model.card["recipe"]["model"]["fusion"]["use"]
        'iterative'
    """

    name: str
    network: AnyNetwork | None
    """Network in `eval` mode; `None` for interpolation."""
    recipe: Recipe | None
    """Recipe of the network; `None` for interpolation."""
    card: dict[str, Any]
    """Card of the weights file; empty for interpolation."""
    path: Path | None
    """Weights file; `None` for interpolation."""
    plugins: tuple[Path, ...]
    """Plugin files with parts of the network."""

    def upsample(
        self,
        points: Any,
        touches: TouchesLike = (),
        rate: float | int | None = None,
        *,
        count: int | None = None,
        keep: bool = True,
        fields: Sequence[str] = (),
        bad: Bad = "refuse",
        denoise: bool | int | float = False,
        pose_error: PoseError | None = None,
        touch_as_is: bool = False,
        jobs: int = 1,
        scheduler: str | None = None,
        advance: Callable[[int, int], None] = lambda done, total: None,
    ) -> Any:
        """Upsample a cloud of any size.

        Args:
            points: (n, 3), in any frame and unit: a numpy array, a torch tensor, a trimesh or an Open3D cloud, a
                `pcsr.clouds.cloud.Cloud`, or what `pcsr.clouds.faults.screen` returned.
            touches: touches in the frame and unit of `points`: a folder with a recording, `Touch` records, arrays
                (m, 3), or a `Registration`. Those of a folder and records are registered to the points that are used,
                after `denoise`. Arrays have no unit and are used as they are; of a `Registration` refused touches are
                left out.
            rate: output points for each used input point, 1.1 to 64; 4 by default. Of exact duplicates one is used.
            count: number of output points, instead of a rate.
            keep: whether the input points are part of the output, before the new points.
            fields: further columns of the result, if `points` is a `Cloud`. `source` is 0 for scanned points, 1 for
                made ones, and 2 for touched points of unseen regions. `error` is the expected distance of each point
                from the true surface, one standard deviation, in the unit of `points`; NaN for points that are not
                used, and for touched points whose error is unknown.
            bad: treatment of points that are not finite, of sentinels such as many points at 0 0 0, and of far
                outliers. "refuse" raises an error, "drop" removes them and copies of duplicates, "keep" keeps them in
                the output and makes the new points as if they were not there.
            denoise: move the input points onto the surface before new ones are made: the standard deviation of the
                noise in the unit of `points`, or True to estimate it. Without noise nothing moves. Touches stay.
            pose_error: error of the poses of the touches; that of the recording by default, or else 1 mm and 2 degrees.
            touch_as_is: use the touches where they were reported, without registration.
            jobs: number of processes.
            scheduler: address of a Dask scheduler whose workers are used instead of local processes.
            advance: called with the number of points processed and the number of all, summed over the passes.

        Returns:
            A cloud of the same kind, in the same frame and unit. Colours, normals and other columns of the new points
            are interpolated from their neighbours.

        Raises:
            UserError: points are too few, faulty or all equal, touches are far from the cloud, the number of output
                points or the noise is out of range, or a field is unknown or has no place in a cloud of this kind.

        Warns:
            PcsrWarning: points were dropped or not used, touches are refused by the registration, or touched points
                lie where the cloud has no points.

        Examples:
            >>> cloud = np.random.default_rng(0).normal(size=(100, 3))
            >>> dense = pcsr.load("midpoint").upsample(cloud, rate=2.5)
            >>> dense.shape
            (250, 3)
            >>> bool((dense[:100] == cloud).all())
            True
        """
        screened = points if isinstance(points, ScreenedCloud) else None
        _check_fields(fields, points if screened is None else screened.cloud)
        given = convert(points if screened is None else screened.cloud)
        screened = screen(given.cloud, bad) if screened is None else screened
        if denoise is not False:
            with worker_pool(jobs, scheduler) as workers:
                screened, _ = denoise_cloud(screened, denoise, pool=workers)
        cloud = screened.points
        unused = len(screened.used) - len(cloud) if keep else 0
        wanted = output_count(len(cloud), unused, rate, count)
        given_touches = GivenTouches.of(touches, pose_error, as_is=touch_as_is)
        if isinstance(touches, str | Path):
            given_touches = given_touches.in_frame(cloud)
        given_touches.check(cloud)
        power = exponent([cloud])
        given_touches = given_touches.moved(given_touches.registration(cloud))
        touched = given_touches.points(power)
        cloud = scaled(cloud, -power)
        errors, stages = None, TwoStages(advance, len(cloud) if "error" in fields else 0)
        with worker_pool(jobs, scheduler) as workers:
            source = candidates(self, alone=workers.executor is None)
            new = densify(
                cloud,
                wanted,
                source,
                touches=touched,
                normals=screened.normals,
                keep=keep,
                pool=workers,
                advance=stages.first,
            )
            if "error" in fields:
                errors = upsampled_errors(
                    cloud,
                    new,
                    touches=touched,
                    touch_errors=given_touches.errors(power),
                    removed=float(np.ldexp(screened.removed, -power)),
                    pool=workers,
                    advance=stages.second,
                )
        dense = screened.cloud.with_new(scaled(new.points, power), keep=keep, used=screened.used)
        every = None
        if errors is not None:
            of_given = given_errors(screened, scaled(errors.known, power)) if keep else np.zeros(0)
            every = np.concatenate([of_given, scaled(errors.new, power)])
        return given.restore(dense.with_fields(fields, sources(new.points, touched), every))


def load(
    model: str | Path | None = None, *, plugins: Sequence[str | Path] = (), device: str | torch.device = "cpu"
) -> Model:
    """Load a model.

    Args:
        model: a name (`field`, `frames`, `tapsr`, `pu-transformer`, or `midpoint` for interpolation), a run folder, a
            weights file, or `org/name` on the Hugging Face hub (extra `[hub]`); `field` by default.
        plugins: plugin files with parts that the weights need.
        device: torch device of the network.

    Raises:
        UserError: there is no such model, its file is damaged, or a part that it needs is not installed.

    Examples:
        >>> cloud = np.random.default_rng(0).normal(size=(64, 3))
        >>> pcsr.load().upsample(cloud, rate=2).shape
        (128, 3)
        >>> pcsr.load("midpoint").name
        'midpoint'
    """
    files = plugin_paths(plugins)
    name = DEFAULT if model is None else str(model)
    if not name:
        raise UserError("the model is an empty text: give a name, a run folder or a weights file")
    if name == INTERPOLATION:
        return Model(name, None, None, {}, None, files)
    path = find(name, paths_first=True, hub=True, others=[INTERPOLATION])
    registry = load_plugins(files)
    check_loaded(registry)
    network, recipe, card = load_weights(path, registry)
    try:
        network.to(device)
    except (RuntimeError, AssertionError) as error:
        raise UserError(f"device '{device}' cannot be used: {str(error).splitlines()[0]}") from error
    return Model(name, network, recipe, card, path, files)


def candidates(model: Model, *, alone: bool) -> Candidates:
    """Return the source of a model's candidates, for this process `alone` or for worker processes.

    Raises:
        UserError: the model is in memory alone, and `alone` is not set.
    """
    if model.network is None or model.recipe is None:
        return Midpoints()
    source = Networked.of(model.network, model.recipe)
    if alone:
        return source
    if model.path is None:
        raise UserError("a model that is in memory alone cannot be sent to other processes: take one process")
    return Stored(
        model.path.resolve(), model.plugins, source.size, source.rate, source.any_rate, source.corrects_points
    )


def check_fields(fields: Sequence[str]) -> None:
    """Check the names of further columns of the result.

    Raises:
        UserError: a field is unknown.
    """
    for name in fields:
        if name not in FIELDS:
            raise UserError(f"field {name!r} is unknown: fields are {', '.join(FIELDS)}")


def _check_fields(fields: Sequence[str], points: Any) -> None:
    check_fields(fields)
    if fields and not isinstance(points, Cloud):
        kind = type(points).__name__
        raise UserError(f"field '{fields[0]}' is a column, which a {kind} cannot hold: give a pcsr.clouds.cloud.Cloud")


def sources(new: Float[np.ndarray, "new 3"], touched: list[Float[np.ndarray, "_ 3"]]) -> Int[np.ndarray, " new"]:
    """Return which new points are touched points: `densify` adds those of unseen regions unchanged."""
    if not touched:
        return np.full(len(new), MADE)
    distance = cKDTree(np.concatenate(touched)).query(new)[0]
    return np.where(distance == 0, TOUCHED, MADE)


def output_count(n: int, unused: int, rate: float | int | None, count: int | None) -> int:
    """Return the number of output points besides the unused input points, which are part of `count` alone."""
    if rate is not None and count is not None:
        raise UserError(f"rate {rate:g} and count {count} exclude each other: give one of them (--rate, --points)")
    if count is not None:
        if count < 1:
            raise UserError(f"count is {count}: at least one point must come out")
        if count > RATES[1] * n:
            raise UserError(f"count is {count}, more than {RATES[1]:g} times the cloud's {n} points: ask for fewer")
        if unused and count < n + unused:
            raise UserError(
                f"{count} points are fewer than the {n + unused} of the cloud: ask for more, or don't keep the old "
                f"ones (--replace)"
            )
        return count - unused
    rate = 4.0 if rate is None else float(rate)
    if not RATES[0] <= rate <= RATES[1]:
        raise UserError(
            f"rate is {rate:g}: it must be {RATES[0]:g} to {RATES[1]:g}; for fewer points give a count (--points)"
        )
    return round(rate * n)
