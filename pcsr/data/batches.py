"""Batches for training: objects, their touches, and augmentation (TAPSR, Sec. 4.2.2).

The random numbers of a row are determined by the seed, the step and the position in the batch. A run that is resumed,
or distributed over several processes, thus gets the same batches as one that is not.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from pcsr.contracts import TouchBatch
from pcsr.data.dataset import Split
from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.frames import UnitSphere
from pcsr.geometry.patches import in_patch
from pcsr.recipe import Patches

EVEN = 0.5
"""Share of the redrawn clouds that are evenly spaced, with the augmentation `even`."""
POOLS = (2, 4, 8, 16)
"""Evenly spaced clouds are the farthest points of a random pool that is this many times as large. Publications mostly
use the largest pool; smaller ones resemble scans and take less time."""
CROPPED = 0.25
"""Share of the batches that are cropped, with the augmentation `crop`."""
TOUCHED = 0.5
"""Share of the patches that are centred on a touch, among objects with touches."""
SCALE = (0.8, 1.2)
"""Range of the random scale, as in PU-GAN and later work."""
JITTER = 0.002
"""Standard deviation of the noise on the sparse cloud, in radii of the unit sphere; it is cut off at three of them."""


NOISY = 0.3
"""Share of the clouds with more noise, with the augmentation `noise`."""
NOISE = (0.002, 0.02)
"""Range of its standard deviation, in radii of the unit sphere, drawn log-uniformly."""
UNEVEN = 0.3
"""Share of the other redrawn clouds whose density varies, with the augmentation `uneven`."""
CONTRAST = 8.0
"""Largest ratio of the densities of two regions of such a cloud."""


@dataclass(frozen=True)
class Batch:
    """Clouds and touches in the network's frame: before augmentation the sparse cloud fills the unit sphere."""

    points: Float[Tensor, "b n 3"]
    """Sparse clouds."""
    truth: Float[Tensor, "b g 3"]
    """True dense clouds."""
    touches: TouchBatch
    """Touches of the clouds. Some are missing in patches, and for objects that have fewer than the batch."""


@dataclass(frozen=True)
class Batches:
    """The batches of a training run, by number."""

    split: Split
    size: int
    touches: tuple[int, int]
    """Smallest and largest number of touches of a cloud. Each batch draws its own number."""
    augment: Sequence[str]
    """Names of augmentations. `redraw` samples the sparse cloud again from the truth; with `even`, half of the samples
    are evenly spaced. `crop` replaces some batches by halves of objects without touches, so that surfaces have borders
    as in a scan. `rotate`, `scale` and `jitter` transform the clouds. `noise` adds more noise to some; `uneven` lets
    the density of some vary. `other-touches` gives each object the touches of another one."""
    seed: int
    patches: Patches | None = None
    """Size of patches. With patches a row is one patch of an object, and its sparse cloud is sampled from the truth."""

    @property
    def per_epoch(self) -> int:
        """Number of batches in an epoch. Objects that do not fill a batch are left out of the epoch."""
        return max(1, len(self.split) // self.size)

    def at(self, step: int, rank: int = 0, ranks: int = 1) -> Batch:
        """Return the share of process `rank` in batch number `step`."""
        epoch, index = divmod(step, self.per_epoch)
        order = np.random.default_rng((self.seed, epoch)).permutation(len(self.split))
        chosen = order[index * self.size : (index + 1) * self.size]
        low, high = self.touches
        count = int(np.random.default_rng((self.seed, step, 1)).integers(low, high + 1))
        crop = "crop" in self.augment and not self.patches
        crop = crop and np.random.default_rng((self.seed, step, 3)).random() < CROPPED
        count = 0 if crop else count  # a touch may lie on the half that is removed
        share = [i for i in range(len(chosen)) if i * ranks // len(chosen) == rank]
        rows = [self._row(int(chosen[i]), count, crop, np.random.default_rng((self.seed, step, 2, i))) for i in share]
        points, truth, touched, mask = (torch.stack(tensors) for tensors in zip(*rows, strict=True))
        return Batch(points, truth, TouchBatch.of(touched, mask))

    def _redrawn(
        self, truth: Float[np.ndarray, "g 3"], count: int, rng: np.random.Generator
    ) -> Int[np.ndarray, " count"]:
        """Sample a sparse cloud from the truth. Networks trained on random samples alone fail on even ones."""
        if "even" in self.augment and rng.random() < EVEN:
            pool = rng.permutation(len(truth))[: int(rng.choice(POOLS)) * count]
            even: Int[np.ndarray, " count"] = pool[farthest_points(truth[pool], count, int(rng.integers(len(pool))))]
            return even
        if "uneven" in self.augment and rng.random() < UNEVEN:
            return uneven_subset(truth, count, rng)
        return rng.choice(len(truth), count, replace=False)

    def _patch(self, patches: Patches, truth: Tensor, touched: Tensor, rng: np.random.Generator) -> Tensor:
        """Cut the nearest points of the truth around a centre, which is often a touch: few have one by chance."""
        middle = truth[int(rng.integers(len(truth)))]
        if len(touched) and rng.random() < TOUCHED:
            middle = touched[int(rng.integers(len(touched)))].mean(0)
        away: Tensor = (truth - middle).norm(dim=1)
        return truth[away.topk(patches.points * patches.rate, largest=False).indices]

    def _other(self, item: int, rng: np.random.Generator) -> int:
        """Draw another object; of a single one, that one."""
        return (item + int(rng.integers(1, max(2, len(self.split))))) % len(self.split)

    def _cropped(self, truth: Tensor, points: Tensor, drawn: bool, rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        """Keep half of the truth and half of the cloud: one side of both, if the cloud was sampled from the truth."""
        if not drawn:
            half = [rng.permutation(len(cloud))[: len(cloud) // 2] for cloud in (truth, points)]
            return truth[torch.from_numpy(half[0])], points[torch.from_numpy(half[1])]
        middle = truth[int(rng.integers(len(truth)))]
        away = [(cloud - middle).norm(dim=1) for cloud in (truth, points)]
        kept = [far.topk(len(far) // 2, largest=False).indices for far in away]
        return truth[kept[0]], points[kept[1]]

    def _row(
        self, item: int, count: int, crop: bool, rng: np.random.Generator
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        truth = self.split.truth[item]
        points = self.split.points[item]
        touched = self.split.touches[self._other(item, rng) if "other-touches" in self.augment else item]
        drawn = _is_part(points, truth)
        if self.patches:
            touched = touched[torch.from_numpy(rng.permutation(len(touched))[:count])]
            truth = self._patch(self.patches, truth, touched, rng)
            points = truth[torch.from_numpy(self._redrawn(truth.numpy(), self.patches.points, rng))]
        else:
            if crop:
                truth, points = self._cropped(truth, points, drawn, rng)
            if "redraw" in self.augment and drawn:
                points = truth[torch.from_numpy(self._redrawn(truth.numpy(), len(points), rng))]
            touched = touched[torch.from_numpy(rng.permutation(len(touched))[:count])]
        sphere = UnitSphere.fit(points.numpy())
        clouds = [torch.from_numpy(sphere.normalize(cloud.numpy())) for cloud in (points, touched, truth)]
        mask = in_patch(clouds[1]) if self.patches else torch.ones(len(touched), dtype=torch.bool)
        if "rotate" in self.augment:
            turn = torch.from_numpy(_rotation(rng))
            clouds = [cloud @ turn for cloud in clouds]
        if "scale" in self.augment:
            factor = float(rng.uniform(*SCALE))
            clouds = [cloud * factor for cloud in clouds]
        points, touched, truth = clouds
        if "jitter" in self.augment:
            points = points + _noise(JITTER, points, rng)
        if "noise" in self.augment and rng.random() < NOISY:
            points = points + _noise(math.exp(rng.uniform(*np.log(NOISE))), points, rng)
        missing = count - len(touched)  # of an object whose touches could not all be registered
        touched = torch.cat([touched, touched.new_zeros(missing, *touched.shape[1:])])
        return points, truth, touched, torch.cat([mask, mask.new_zeros(missing)])


def usable(augment: Sequence[str], sampling: str) -> list[str]:
    """Return the augmentations that suit clouds of a sampling: only random ones are redrawn.

    A cloud that is redrawn from the truth is neither a view from one side nor evenly spaced.
    """
    return [name for name in augment if name != "redraw" or sampling in ("random", "mixed")]


def _is_part(points: Float[Tensor, "n 3"], truth: Float[Tensor, "g 3"]) -> bool:
    """Whether a cloud was sampled from the truth. The view of a camera was not, and must not be sampled again."""
    return bool((truth == points[0]).all(1).any())


def _noise(sigma: float, points: Float[Tensor, "n 3"], rng: np.random.Generator) -> Float[Tensor, "n 3"]:
    """Draw Gaussian noise, cut off at three standard deviations."""
    noise = rng.normal(0, sigma, tuple(points.shape)).clip(-3 * sigma, 3 * sigma)
    return torch.from_numpy(noise.astype(np.float32))


def uneven_subset(truth: Float[np.ndarray, "g 3"], count: int, rng: np.random.Generator) -> Int[np.ndarray, " count"]:
    """Choose random points of a cloud, some of its regions denser than others, as near a scanner.

    The density changes exponentially along a random direction, by up to `CONTRAST`.
    """
    direction = rng.normal(size=3)
    along = truth @ (direction / np.linalg.norm(direction))
    share = (along - along.min()) / max(np.ptp(along), np.finfo(float).tiny)
    weight = np.exp(rng.uniform(0, math.log(CONTRAST)) * share)
    chosen: Int[np.ndarray, " count"] = rng.choice(len(truth), count, replace=False, p=weight / weight.sum())
    return chosen


def _rotation(rng: np.random.Generator) -> Float[np.ndarray, "3 3"]:
    """Draw a rotation uniformly: the Q of a Gaussian matrix, signs fixed, without reflection."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 0] *= np.sign(np.linalg.det(q))
    return q.astype(np.float32)
