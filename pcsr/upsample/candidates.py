"""Sources of candidate points for a patch: a network, or interpolation."""

import functools
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from pcsr.contracts import TouchBatch, Trait
from pcsr.errors import PcsrWarning
from pcsr.geometry.interpolation import midpoint
from pcsr.network.kinds import AnyNetwork
from pcsr.network.load import load_weights
from pcsr.network.network import Network
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import PartSpec, Recipe
from pcsr.tensors import CloudArray
from pcsr.upsample.checks import check_finite

FEW = 4
"""Rate up to which midpoints of the nearest neighbours are enough to choose from."""
LOCAL_SIZE = 1024
"""Number of points of a patch for networks whose parts are all local, whatever it was in training: the larger a patch,
the smaller the share of its margin, and the more even the result."""
TOUCH_POINTS = 512
"""Number of points of a touch where the weights do not say how many there were in training."""
BLOCK = 31 << 20
"""Bytes of the largest block of memory that is reused rather than returned to the system."""
MOST_TOUCH_POINTS = 1 << 16
"""Largest plausible number of points of a touch in training."""


@dataclass(frozen=True)
class Generated:
    """Generated points: candidates for a patch, or those that are chosen among them."""

    points: CloudArray
    """(c 3)."""
    errors: Float[np.ndarray, " c"]
    """Predicted distance of each point from the surface, in the unit of the points; 0 where none is predicted."""

    @classmethod
    def of(cls, points: CloudArray) -> "Generated":
        """Create points without predicted errors."""
        return cls(points, np.zeros(len(points)))

    @classmethod
    def joined(cls, parts: Sequence["Generated"]) -> "Generated":
        """Put points one after the other."""
        return cls(np.concatenate([part.points for part in parts]), np.concatenate([part.errors for part in parts]))


class Candidates:
    """Base class of candidate sources. They are sent to worker processes, so that pickling must be cheap."""

    size: int
    """Number of points of a patch."""
    rate: int
    """Number of candidates for each point of a patch, unless any number can be generated."""
    any_rate: bool
    """Whether any number of candidates can be generated for each point."""
    corrects_points: bool = False
    """Whether a corrected copy of each point is among the candidates."""

    def __call__(self, points: CloudArray, touches: Sequence[CloudArray], rate: int) -> Generated:
        """Generate candidates for a patch. All clouds are in the frame in which the patch fills the unit sphere.

        Args:
            points: the patch, (n 3).
            touches: touched points near the patch, (m 3) for each touch.
            rate: candidates for each point: the source's own `rate`, or another one if it has `any_rate`.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class Midpoints(Candidates):
    """Candidates by interpolation."""

    size: int = 512
    rate: int = 16
    any_rate: bool = True

    def __call__(self, points: CloudArray, touches: Sequence[CloudArray], rate: int) -> Generated:
        """Return midpoints of neighbours, or of more neighbours in two passes for a rate above 4; touches are ignored.

        In two passes there are always `self.rate` for each point: more of them lie well than of fewer.
        """
        return Generated.of(midpoint(points, rate) if rate <= FEW else midpoint(points, self.rate, passes=2))


@dataclass(frozen=True)
class Networked(Candidates):
    """Candidates from a network in memory."""

    network: AnyNetwork
    size: int
    rate: int
    any_rate: bool
    most_touches: int
    """Largest number of touches in training. If there are more, the nearest are used."""
    touch_points: int
    """Number of points of each touch in training."""
    corrects_points: bool = False

    @classmethod
    def of(cls, network: AnyNetwork, recipe: Recipe) -> "Networked":
        """Create the source from a network and the recipe that it was trained with."""
        any_rate = Trait.ANY_RATE in network.upsampler.traits
        return cls(
            network,
            LOCAL_SIZE if any_rate and _is_local(network) else recipe.network_points,
            recipe.network_rate,
            any_rate,
            recipe.most_touches,
            _touch_points(recipe.data.touch),
            network.upsampler.corrects_points,
        )

    @torch.inference_mode()
    def __call__(self, points: CloudArray, touches: Sequence[CloudArray], rate: int) -> Generated:
        """Return all points that the network generates, before thinning, since `densify` chooses among them.

        Raises:
            RunError: a coordinate is not finite.
        """
        _keep_freed_memory()
        device = next(self.network.parameters()).device

        def tensor(cloud: CloudArray) -> torch.Tensor:
            return torch.from_numpy(cloud.astype(np.float32)).to(device)

        resampled = self._resampled(touches)
        batch = TouchBatch.of(torch.stack([tensor(touch) for touch in resampled])[None]) if resampled else None
        dense, errors = self.network.candidates(tensor(points)[None], rate, batch)
        candidates = dense[0].double().cpu().numpy()
        expected = np.zeros(len(candidates)) if errors is None else errors[0].double().cpu().numpy()
        check_finite(candidates)
        check_finite(expected)
        return Generated(candidates, expected)

    def _resampled(self, touches: Sequence[CloudArray]) -> list[CloudArray]:
        """Return the nearest touches, as many as in training, each with the number of points of training."""
        nearest = sorted(touches, key=lambda touch: float(np.linalg.norm(touch.mean(0))))[: self.most_touches]
        resampled = []
        for touch in nearest:
            rows = np.lexsort(touch.T)  # the result does not depend on the order of the points
            rng = np.random.default_rng(len(rows))
            drawn = [rng.permutation(rows) for _ in range(math.ceil(self.touch_points / len(rows)))]
            resampled.append(touch[np.concatenate(drawn)[: self.touch_points]])
        return resampled


@functools.cache
def _keep_freed_memory() -> None:
    """Let the C library reuse freed memory, where it is glibc's.

    It returns large freed blocks to the system, and gets them back page by page, which took a third of the network's
    time; up to the largest block that was ever freed, at most 32 MiB, it keeps them.
    """
    block = torch.empty(BLOCK, dtype=torch.uint8)  # never written, so that it takes no memory
    del block


def _is_local(network: AnyNetwork) -> bool:
    """Return whether the features of a point depend on the points around it alone."""
    if not isinstance(network, Network) or network.touch_encoder is not None:
        return False
    return all(Trait.LOCAL in part.traits for part in (network.encoder, network.backbone, network.upsampler))


def _touch_points(source: PartSpec) -> int:
    """Return the number of points of a touch in training, if the touch source has a plausible option `points`."""
    points = source.options.get("points")
    return points if type(points) is int and 1 <= points <= MOST_TOUCH_POINTS else TOUCH_POINTS


@dataclass(frozen=True)
class Stored(Candidates):
    """Candidates from a network in a weights file, which is cheaper to send to other processes than the network."""

    path: Path
    plugins: tuple[Path, ...]
    size: int
    rate: int
    any_rate: bool
    corrects_points: bool = False

    def __call__(self, points: CloudArray, touches: Sequence[CloudArray], rate: int) -> Generated:
        """Return the candidates of `Networked`; each process reads the file once."""
        return _loaded(self.path, self.plugins)(points, touches, rate)


@functools.lru_cache(maxsize=2)
def _loaded(path: Path, plugins: tuple[Path, ...]) -> Networked:
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", PcsrWarning
        )  # the process that sent the path has loaded the file and shown its warnings
        network, recipe, _ = load_weights(path, load_plugins(plugins))
    return Networked.of(network, recipe)
