"""Where new points come from: a network, or interpolation. Each gives many candidates for one patch."""

import functools
import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from pcsr.contracts import TouchBatch
from pcsr.errors import PcsrWarning, RunError
from pcsr.geometry.interpolation import midpoint
from pcsr.network.load import load_weights
from pcsr.network.network import Network
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import PartSpec, Recipe

Cloud = Float[np.ndarray, "_ 3"]
TOUCH_POINTS = 512
"""Points that a touch is given where the weights don't say how many it had in training."""
MOST_TOUCH_POINTS = 1 << 16
"""A number of points above this is none that a network was trained with."""


class Candidates:
    """Makes candidates. Cheap to pickle, as processes are sent it."""

    size: int
    """Points of a patch."""
    rate: int
    """Candidates for each of them."""

    def __call__(self, points: Cloud, touches: Sequence[Cloud]) -> Cloud:
        """Candidates for a patch. All clouds are in the frame in which the patch fills the unit sphere."""
        raise NotImplementedError


@dataclass(frozen=True)
class Midpoints(Candidates):
    """Interpolation: twice four, as that beats once sixteen."""

    size: int = 512
    rate: int = 16

    def __call__(self, points: Cloud, touches: Sequence[Cloud]) -> Cloud:
        """Midpoints of neighbours; touches mean nothing to it."""
        return midpoint(points, self.rate, passes=2)


@dataclass(frozen=True)
class Networked(Candidates):
    """A network in memory."""

    network: Network
    size: int
    rate: int
    most_touches: int
    """So many touches it was trained with; of more, the nearest."""
    touch_points: int

    @classmethod
    def of(cls, network: Network, recipe: Recipe) -> "Networked":
        """The network of a recipe, as it was trained."""
        return cls(
            network, recipe.network_points, recipe.network_rate, recipe.most_touches, _touch_points(recipe.data.touch)
        )

    @torch.inference_mode()
    def __call__(self, points: Cloud, touches: Sequence[Cloud]) -> Cloud:
        """What the network makes, before the farthest are kept: `densify` chooses itself.

        Raises:
            RunError: something that is not finite.
        """
        device = next(self.network.parameters()).device

        def tensor(cloud: Cloud) -> torch.Tensor:
            return torch.from_numpy(cloud.astype(np.float32)).to(device)

        felt = self._felt(touches)
        heard = TouchBatch.of(torch.stack([tensor(touch) for touch in felt])[None]) if felt else None
        dense = self.network.candidates(tensor(points)[None], self.rate, heard)[0].float().cpu().numpy()
        if not np.isfinite(dense).all():
            raise RunError("the network gave coordinates that are not finite: its weights are damaged, train it again")
        made: Cloud = dense.astype(np.float64)
        return made

    def _felt(self, touches: Sequence[Cloud]) -> list[Cloud]:
        """As many touches of as many points as the network knows: the nearest ones, thinned or repeated."""
        nearest = sorted(touches, key=lambda touch: float(np.linalg.norm(touch.mean(0))))[: self.most_touches]
        felt = []
        for touch in nearest:
            rows = np.lexsort(touch.T)  # whatever order they came in
            rng = np.random.default_rng(len(rows))
            drawn = [rng.permutation(rows) for _ in range(math.ceil(self.touch_points / len(rows)))]
            felt.append(touch[np.concatenate(drawn)[: self.touch_points]])
        return felt


def _touch_points(source: PartSpec) -> int:
    """Points of a touch in training, where its source says so; it may be anybody's, and its options mean anything."""
    points = source.options.get("points")
    return points if type(points) is int and 1 <= points <= MOST_TOUCH_POINTS else TOUCH_POINTS


@dataclass(frozen=True)
class Stored(Candidates):
    """A network in a weights file: what other processes are sent instead of the network."""

    path: Path
    plugins: tuple[Path, ...]
    size: int
    rate: int

    def __call__(self, points: Cloud, touches: Sequence[Cloud]) -> Cloud:
        """As `Networked`; the file is read once in each process."""
        return _loaded(self.path, self.plugins)(points, touches)


@functools.lru_cache(maxsize=2)
def _loaded(path: Path, plugins: tuple[Path, ...]) -> Networked:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PcsrWarning)  # whoever sent the path has loaded it too, and was warned
        network, recipe, _ = load_weights(path, load_plugins(plugins))
    return Networked.of(network, recipe)
