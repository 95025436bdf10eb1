"""Splits of a data set: for each object the true cloud, the sparse cloud and the touches."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from torch import Tensor

from pcsr.data.shards import CLOUDS, checked_shard, present, read_manifest
from pcsr.errors import UserError
from pcsr.geometry.frames import UnitSphere


@dataclass(frozen=True)
class Split:
    """Objects of one split. The clouds of each are normalised so that the truth fills the unit sphere.

    Clouds that were loaded from a folder are memory-mapped: they are read when they are accessed.
    """

    names: Sequence[str]
    groups: Sequence[str]
    truth: Sequence[Float[Tensor, "g 3"]]
    points: Sequence[Float[Tensor, "n 3"]]
    touches: Sequence[Float[Tensor, "_ m 3"]]
    """Touches of each object. With `data.registration`, some objects have fewer than others, or none."""
    spheres: Sequence[UnitSphere]
    """Normalisation of each object, from its own frame to that of the clouds."""
    covered: Sequence[Sequence[float]]
    """For each object, the share of the truth's points that its first 1, 2, … touches cover. It has a value for each
    touch of the data set; where an object has fewer, the last values are equal."""
    about: dict[str, Any]
    """The data's `fingerprint`, and the `rejected` objects with the reasons."""

    def __len__(self) -> int:
        return len(self.names)

    def chosen(self, rows: Sequence[int]) -> "Split":
        """Return the split of the objects at these indices."""
        return Split(
            names=[self.names[i] for i in rows],
            groups=[self.groups[i] for i in rows],
            truth=[self.truth[i] for i in rows],
            points=[self.points[i] for i in rows],
            touches=[self.touches[i] for i in rows],
            spheres=[self.spheres[i] for i in rows],
            covered=[self.covered[i] for i in rows],
            about=self.about,
        )

    def spread(self, count: int) -> "Split":
        """Return the split of `count` objects at even intervals, so that all groups are represented."""
        count = min(count, len(self))
        return self.chosen([i * len(self) // count for i in range(count)])

    def coverage(self, touches: int) -> float:
        """Return the mean share of the truth's points that the first `touches` touches cover."""
        return float(np.mean([shares[touches - 1] for shares in self.covered])) if touches else 0.0

    @classmethod
    def joined(cls, splits: Sequence["Split"]) -> "Split":
        """Return several splits as one, in their order.

        The number of touches is that of the split with the fewest. Objects keep their names, so that two may have the
        same. The fingerprint is dropped.

        Raises:
            UserError: the splits' clouds or touches differ in their number of points.
        """
        if len(splits) == 1:
            return splits[0]
        count = min(len(shares) for split in splits for shares in split.covered)
        for name in CLOUDS:
            first = 1 if name == "touches" else 0  # the number of touches may differ
            sizes = {tuple(getattr(split, name)[0].shape[first:]) for split in splits}
            if len(sizes) > 1 and (count or name != "touches"):
                numbers = " and ".join(str(size[0]) for size in sorted(sizes))
                raise UserError(f"data cannot be joined: {name} of {numbers} points; build all with the same number")

        def all_of(name: str) -> list[Any]:
            return [one for split in splits for one in getattr(split, name)]

        rejected = [split.about["rejected"].items() for split in splits]
        return cls(
            names=all_of("names"),
            groups=all_of("groups"),
            truth=all_of("truth"),
            points=all_of("points"),
            # In data without touches the shape is (0, 0, 3) everywhere.
            touches=[touches[:count] if count else touches[:0, :0] for touches in all_of("touches")],
            spheres=all_of("spheres"),
            covered=[shares[:count] for shares in all_of("covered")],
            about={"rejected": {f"{n}: {name}": why for n, pairs in enumerate(rejected, 1) for name, why in pairs}},
        )

    @classmethod
    def load(
        cls,
        folder: Path,
        split: str,
        shards: Sequence[int] | None = None,
        advance: Callable[[int], None] = lambda count: None,
    ) -> "Split":
        """Load a split from a folder. The hash of each file is checked, once for each process.

        Args:
            folder: folder that `pcsr data make` built.
            split: "train", "validation" or "test".
            shards: numbers of the shards to load; all by default.
            advance: called with the number of objects that were just read.

        Raises:
            UserError: the folder has no such finished split, a file is damaged, or no object could be used.
        """
        manifest = read_manifest(folder)
        about = manifest.splits.get(split)
        if about is None:
            there = ", ".join(manifest.splits) or "none"
            why = manifest.empty.get(split, "run `pcsr data make` again to finish it")
            raise UserError(f"{folder} has no split '{split}' (it has: {there}): {why}")
        rejected: dict[str, str] = {}
        lists: dict[str, list[Any]] = {name: [] for name in ("names", "groups", "spheres", "covered", *CLOUDS)}
        for number in range(len(about.shards)) if shards is None else shards:
            card, clouds = checked_shard(folder, manifest, split, number)
            rejected.update(card.rejected)
            if card.names:
                lists["names"] += card.names
                lists["groups"] += card.groups
                lists["spheres"] += [UnitSphere(np.array(s[:3]), s[3]) for s in card.spheres]
                lists["covered"] += card.coverage
                for name in CLOUDS:
                    rows = clouds[name].unbind(0)
                    lists[name] += map(present, rows) if name == "touches" else rows
            advance(len(card.names))
        if not lists["names"]:
            reasons = "; ".join(list(rejected.values())[:3])
            raise UserError(f"{folder}: none of the objects of the split '{split}' could be used: {reasons}")
        return cls(about={"fingerprint": manifest.fingerprint, "rejected": rejected}, **lists)
