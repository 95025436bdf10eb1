"""Data that is built already, in one folder or in several, and a recipe on it."""

import dataclasses
import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcsr.data.dataset import Split
from pcsr.data.plan import SPLITS
from pcsr.data.schema import Manifest
from pcsr.data.shards import read_manifest
from pcsr.errors import UserError
from pcsr.plugins.registry import Registry
from pcsr.recipe import PARTS, Recipe, from_resolved


@dataclass(frozen=True)
class Built:
    """Folders that `pcsr data make` built, as one data set in their order."""

    folders: tuple[Path, ...]
    manifests: tuple[Manifest, ...]

    @classmethod
    def read(cls, folders: Sequence[Path]) -> "Built":
        """Look at what they hold.

        Raises:
            UserError: one is no such folder or is named twice, or their clouds differ in size.
        """
        for number, folder in enumerate(folders):
            if folder.resolve() in [other.resolve() for other in folders[:number]]:
                raise UserError(f"--data {folder} is given twice: its objects would count twice, so give it once")
        built = cls(tuple(folders), tuple(map(read_manifest, folders)))
        first, *others = zip(built.folders, built.manifests, strict=True)
        for folder, manifest in others:
            for key in ("points", "rate"):
                one, other = getattr(first[1].data, key), getattr(manifest.data, key)
                if one != other:
                    raise UserError(
                        f"{first[0]} and {folder} cannot be joined: {key} is {one} in the first and {other} in the "
                        f"second; build them alike, with --set {key}={one}"
                    )
        return built

    @property
    def fingerprint(self) -> str:
        """That of the folder; of several a hash of theirs, in their order."""
        if not self.joined:
            return self.manifests[0].fingerprint
        return hashlib.sha256(json.dumps(self.joined).encode()).hexdigest()

    @property
    def joined(self) -> tuple[str, ...]:
        """The fingerprints of several folders; nothing for a single one."""
        return tuple(one.fingerprint for one in self.manifests) if len(self.manifests) > 1 else ()

    def holders(self, split: str) -> list[int]:
        """The numbers of the folders that have a split."""
        return [number for number, manifest in enumerate(self.manifests) if split in manifest.splits]

    def missing(self) -> list[str]:
        """For each folder that lacks a split which another has, a line that says so."""
        return [
            f"{folder} has no split '{split}': {manifest.empty.get(split, 'it is not built to its end')}"
            for split in SPLITS
            if self.holders(split)
            for folder, manifest in zip(self.folders, self.manifests, strict=True)
            if split not in manifest.splits
        ]

    def shards(self, split: str) -> list[Path]:
        """The files of a split, in all folders."""
        return [
            self.folders[number] / shard.file
            for number in self.holders(split)
            for shard in self.manifests[number].splits[split].shards
        ]

    def objects(self, split: str) -> int:
        """How many objects of a split all folders have."""
        return sum(self.manifests[number].splits[split].objects for number in self.holders(split))

    def split(self, split: str, advance: Callable[[int], None] = lambda count: None) -> Split:
        """A split of all folders that have it.

        Args:
            split: "train", "validation" or "test".
            advance: called with the number of objects that were just read and checked.

        Raises:
            UserError: none has it, a file is damaged, or the clouds differ in size.
        """
        holders = self.holders(split) or [0]  # which says what is wrong
        whole = Split.joined([Split.load(self.folders[number], split, advance=advance) for number in holders])
        return dataclasses.replace(whole, about={**whole.about, "fingerprint": self.fingerprint})

    def card(self) -> list[dict[str, Any]]:
        """What weights that were trained on it say of it: of each folder its name, and what its manifest says."""
        return [
            {
                "folder": folder.resolve().name,
                "fingerprint": manifest.fingerprint,
                "settings": manifest.data.model_dump(mode="json"),
                "objects": {split: about.objects for split, about in manifest.splits.items()},
            }
            for folder, manifest in zip(self.folders, self.manifests, strict=True)
        ]

    def lay_under(self, recipe: Recipe, registry: Registry) -> Recipe:
        """The recipe on this data: all but the number of touches is as the manifest says.

        Of several folders the first with a split `test` says it; where they differ in sampling, it is mixed.

        Raises:
            UserError: the recipe asks for more touches than the data has, for meshes of several folders, or the data
                names parts that are not installed.
        """
        self._check_touches(recipe)
        testing = self.holders("test")
        self._check_meshes(recipe, testing, registry)
        data = self.manifests[testing[0] if testing else 0].data.model_dump(mode="json")
        if len({manifest.data.sampling for manifest in self.manifests}) > 1:
            data["sampling"] = "mixed"
        plain = recipe.resolved()
        plain["data"] = {**data, "touches": recipe.data.touches}
        plain["joined"] = list(self.joined)
        parts = PARTS.keys() - ({("train", "objective")} if recipe.weights else set())  # with weights none is needed
        on = from_resolved(plain, registry, f"{recipe.name} on {' and '.join(map(str, self.folders))}", parts)
        # What made the data is in their fingerprint, whatever the code of those parts is by now.
        return on.model_copy(update={"code": {k: v for k, v in on.code.items() if not k.startswith("data.")}})

    def _check_touches(self, recipe: Recipe) -> None:
        wanted = recipe.data.touches if recipe.weights else recipe.most_touches  # nothing is trained with weights
        for folder, manifest in zip(self.folders, self.manifests, strict=True):
            has = manifest.data.touches
            if wanted > has:
                raise UserError(
                    f"{folder} has {has} touches of each object, and '{recipe.name}' asks for {wanted}: "
                    f"build it with --set touches={wanted}, or lower data.touches and train.touches"
                )

    def _check_meshes(self, recipe: Recipe, testing: Sequence[int], registry: Registry) -> None:
        """Meshes are found by the names of objects, which those of one folder alone know."""
        wanting = recipe.measured_on_meshes(registry)
        shapes = (self.manifests[number].data.shapes.model_dump(mode="json") for number in testing)
        several = {json.dumps(one, sort_keys=True) for one in shapes}
        if wanting and len(several) > 1:
            folders = " and ".join(str(self.folders[number]) for number in testing)
            raise UserError(
                f"'{wanting[0]}' needs the meshes, and the test objects of {folders} are of different shapes: "
                f"evaluate on one of them, or leave it out of evaluate"
            )
