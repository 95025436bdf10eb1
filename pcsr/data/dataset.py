"""A split of the data set: clouds, object by object, with what they are."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from torch import Tensor

from pcsr.data.shards import CLOUDS, checked_shard, read_manifest
from pcsr.errors import UserError
from pcsr.geometry.frames import UnitSphere


@dataclass(frozen=True)
class Split:
    """All objects of one split. Clouds are in the frame in which the truth fills the unit sphere.

    Clouds of a split that was read from a folder stay there until they are looked at.
    """

    names: Sequence[str]
    groups: Sequence[str]
    truth: Sequence[Float[Tensor, "g 3"]]
    points: Sequence[Float[Tensor, "n 3"]]
    touches: Sequence[Float[Tensor, "a m 3"]]
    spheres: Sequence[UnitSphere]
    """For each object, how its own frame became this one."""
    felt: Sequence[Sequence[float]]
    """For each object, the share of its truth that its first touch felt, its first two, and so on."""
    about: dict[str, Any]
    """The data's fingerprint, and the objects left out with the reasons (`rejected`)."""

    def __len__(self) -> int:
        return len(self.names)

    def chosen(self, rows: Sequence[int]) -> "Split":
        """Some of its objects."""
        return Split(
            names=[self.names[i] for i in rows],
            groups=[self.groups[i] for i in rows],
            truth=[self.truth[i] for i in rows],
            points=[self.points[i] for i in rows],
            touches=[self.touches[i] for i in rows],
            spheres=[self.spheres[i] for i in rows],
            felt=[self.felt[i] for i in rows],
            about=self.about,
        )

    def spread(self, count: int) -> "Split":
        """`count` objects, evenly spread over the split, so that every group stays in."""
        count = min(count, len(self))
        return self.chosen([i * len(self) // count for i in range(count)])

    def coverage(self, touches: int) -> float:
        """Mean share of the truth's points that the first `touches` touches cover."""
        return float(np.mean([shares[touches - 1] for shares in self.felt])) if touches else 0.0

    @classmethod
    def joined(cls, splits: Sequence["Split"]) -> "Split":
        """Several as one, in their order, with as many touches as every object has.

        Objects keep their names, of which two may then be the same; the fingerprint is left out.

        Raises:
            UserError: their clouds or touches are of different sizes.
        """
        if len(splits) == 1:
            return splits[0]
        count = min(len(touches) for split in splits for touches in split.touches)
        for name in CLOUDS:
            skipped = 1 if name == "touches" else 0  # their number may differ
            sizes = {tuple(getattr(split, name)[0].shape[skipped:]) for split in splits}
            if len(sizes) > 1 and (count or name != "touches"):
                numbers = " and ".join(str(size[0]) for size in sorted(sizes))
                raise UserError(f"data cannot be joined: {name} of {numbers} points; build all of it alike")

        def all_of(name: str) -> list[Any]:
            return [one for split in splits for one in getattr(split, name)]

        rejected = [split.about["rejected"].items() for split in splits]
        return cls(
            names=all_of("names"),
            groups=all_of("groups"),
            truth=all_of("truth"),
            points=all_of("points"),
            # Without any touch all have no points either, so that they are of one size.
            touches=[touches[:count] if count else touches[:0, :0] for touches in all_of("touches")],
            spheres=all_of("spheres"),
            felt=[shares[:count] for shares in all_of("felt")],
            about={"rejected": {f"{n}: {name}": why for n, some in enumerate(rejected, 1) for name, why in some}},
        )

    @classmethod
    def load(
        cls,
        folder: Path,
        split: str,
        shards: Sequence[int] | None = None,
        advance: Callable[[int], None] = lambda count: None,
    ) -> "Split":
        """Read a split from a folder that holds it whole. Each file is held against its hash, once in a process.

        Args:
            folder: as `pcsr data make` leaves it.
            split: "train", "validation" or "test".
            shards: the numbers of those to read; all by default.
            advance: called with the number of objects that were just read.

        Raises:
            UserError: it isn't there, a file of it is damaged, or none of its objects could be used.
        """
        manifest = read_manifest(folder)
        about = manifest.splits.get(split)
        if about is None:
            there = ", ".join(manifest.splits) or "none"
            why = manifest.empty.get(split, "run `pcsr data make` to its end")
            raise UserError(f"{folder} has no split '{split}' (it has: {there}): {why}")
        rejected: dict[str, str] = {}
        lists: dict[str, list[Any]] = {name: [] for name in ("names", "groups", "spheres", "felt", *CLOUDS)}
        for number in range(len(about.shards)) if shards is None else shards:
            card, clouds = checked_shard(folder, manifest, split, number)
            rejected.update(card.rejected)
            if card.names:
                lists["names"] += card.names
                lists["groups"] += card.groups
                lists["spheres"] += [UnitSphere(np.array(s[:3]), s[3]) for s in card.spheres]
                lists["felt"] += card.coverage
                for name in CLOUDS:
                    lists[name] += clouds[name].unbind(0)
            advance(len(card.names))
        if not lists["names"]:
            reasons = "; ".join(list(rejected.values())[:3])
            raise UserError(f"{folder}: none of the objects of the split '{split}' could be used: {reasons}")
        return cls(about={"fingerprint": manifest.fingerprint, "rejected": rejected}, **lists)
