"""Batches for training: which objects, which of their touches, and how they are augmented (TAPSR, Sec. 4.2.2).

Everything random follows from the seed, the step and the place in the batch. So a run that stops and goes on, or
that is spread over several processes, sees the same numbers as one that does neither.
"""

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
"""Share of the redrawn clouds that are evenly spaced, more or less:"""
POOLS = (2, 4, 8, 16)
"""farthest points of this many times as many random ones. Of all 16 times as many points of a truth is what most
publications call even; of fewer is what scanners give, and takes a fraction of the time."""
CROPPED = 0.25
"""Share of the batches that are cropped, if any are."""
TOUCHED = 0.5
"""Share of the patches whose middle is that of a touch, where there is one."""
SCALE = (0.8, 1.2)
"""Random scaling, as in PU-GAN and those after it."""
JITTER = 0.002
"""Standard deviation of the noise on the sparse cloud, in radii of the unit sphere, cut off at three of them."""


@dataclass(frozen=True)
class Batch:
    """Clouds in the network's frame: the sparse cloud fills the unit sphere, before augmentation."""

    points: Float[Tensor, "b n 3"]
    truth: Float[Tensor, "b g 3"]
    touches: TouchBatch
    """All of them present, unless the rows are patches."""


@dataclass(frozen=True)
class Batches:
    """The batches of a training run, by number."""

    split: Split
    size: int
    touches: tuple[int, int]
    """Fewest and most touches; each batch draws its own number."""
    augment: Sequence[str]
    """`redraw` draws the sparse cloud anew from the truth, at random or, with `even`, half of the time evenly; `crop`
    takes half of an object now and then, without touches, as a part of a scan, so that surfaces end somewhere."""
    seed: int
    patches: Patches | None = None
    """With them a row is one patch of an object, and its sparse cloud is always drawn from the truth."""

    @property
    def per_epoch(self) -> int:
        """Batches in an epoch; objects that don't fill one wait for another epoch's order."""
        return max(1, len(self.split) // self.size)

    def at(self, step: int, rank: int = 0, ranks: int = 1) -> Batch:
        """The share of process `rank` in batch number `step`."""
        epoch, place = divmod(step, self.per_epoch)
        order = np.random.default_rng((self.seed, epoch)).permutation(len(self.split))
        chosen = order[place * self.size : (place + 1) * self.size]
        low, high = self.touches
        count = int(np.random.default_rng((self.seed, step, 1)).integers(low, high + 1))
        crop = "crop" in self.augment and not self.patches
        crop = crop and np.random.default_rng((self.seed, step, 3)).random() < CROPPED
        count = 0 if crop else count  # a touch may lie on the half that is gone
        share = [i for i in range(len(chosen)) if i * ranks // len(chosen) == rank]
        rows = [self._row(int(chosen[i]), count, crop, np.random.default_rng((self.seed, step, 2, i))) for i in share]
        points, truth, touched, mask = (torch.stack(tensors) for tensors in zip(*rows, strict=True))
        return Batch(points, truth, TouchBatch.of(touched, mask))

    def _redrawn(
        self, truth: Float[np.ndarray, "g 3"], count: int, rng: np.random.Generator
    ) -> Int[np.ndarray, " count"]:
        """Another sparse cloud of the truth. Networks that saw random ones alone do harm to even ones."""
        if "even" in self.augment and rng.random() < EVEN:
            pool = rng.permutation(len(truth))[: int(rng.choice(POOLS)) * count]
            even: Int[np.ndarray, " count"] = pool[farthest_points(truth[pool], count, int(rng.integers(len(pool))))]
            return even
        return rng.choice(len(truth), count, replace=False)

    def _patch(self, patches: Patches, truth: Tensor, felt: Tensor, rng: np.random.Generator) -> Tensor:
        """The points of the truth that are nearest to one of them; often one that was touched, or few would be."""
        middle = truth[int(rng.integers(len(truth)))]
        if len(felt) and rng.random() < TOUCHED:
            middle = felt[int(rng.integers(len(felt)))].mean(0)
        away: Tensor = (truth - middle).norm(dim=1)
        return truth[away.topk(patches.points * patches.rate, largest=False).indices]

    def _cropped(self, truth: Tensor, points: Tensor, drawn: bool, rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        """Half of the truth's points and half of the cloud's: on one side, if the cloud was drawn from the truth."""
        if not drawn:
            half = [rng.permutation(len(cloud))[: len(cloud) // 2] for cloud in (truth, points)]
            return truth[torch.from_numpy(half[0])], points[torch.from_numpy(half[1])]
        middle = truth[int(rng.integers(len(truth)))]
        away = [(cloud - middle).norm(dim=1) for cloud in (truth, points)]
        near = [far.topk(len(far) // 2, largest=False).indices for far in away]
        return truth[near[0]], points[near[1]]

    def _row(
        self, item: int, count: int, crop: bool, rng: np.random.Generator
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        truth = self.split.truth[item]
        points = self.split.points[item]
        felt = self.split.touches[item]
        drawn = _is_part(points, truth)
        if self.patches:
            felt = felt[torch.from_numpy(rng.permutation(len(felt))[:count])]
            truth = self._patch(self.patches, truth, felt, rng)
            points = truth[torch.from_numpy(self._redrawn(truth.numpy(), self.patches.points, rng))]
        else:
            if crop:
                truth, points = self._cropped(truth, points, drawn, rng)
            if "redraw" in self.augment and drawn:
                points = truth[torch.from_numpy(self._redrawn(truth.numpy(), len(points), rng))]
            felt = felt[torch.from_numpy(rng.permutation(len(felt))[:count])]
        sphere = UnitSphere.fit(points.numpy())
        clouds = [torch.from_numpy(sphere.apply(cloud.numpy())) for cloud in (points, felt, truth)]
        mask = in_patch(clouds[1]) if self.patches else torch.ones(count, dtype=torch.bool)
        if "rotate" in self.augment:
            turn = torch.from_numpy(_rotation(rng))
            clouds = [cloud @ turn for cloud in clouds]
        if "scale" in self.augment:
            factor = float(rng.uniform(*SCALE))
            clouds = [cloud * factor for cloud in clouds]
        points, felt, truth = clouds
        if "jitter" in self.augment:
            noise = rng.normal(0, JITTER, tuple(points.shape)).clip(-3 * JITTER, 3 * JITTER)
            points = points + torch.from_numpy(noise.astype(np.float32))
        return points, truth, felt, mask


def _is_part(points: Float[Tensor, "n 3"], truth: Float[Tensor, "g 3"]) -> bool:
    """Whether a cloud was drawn from the truth. What a camera saw was not, and drawn anew it would be another's."""
    return bool((truth == points[0]).all(1).any())


def _rotation(rng: np.random.Generator) -> Float[np.ndarray, "3 3"]:
    """A rotation drawn uniformly: the Q of a Gaussian matrix, signs fixed, without reflection."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 0] *= np.sign(np.linalg.det(q))
    return q.astype(np.float32)
