"""Data sets that are built already, in one folder or several, as the data of a recipe."""

import dataclasses
import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcsr.contracts import SPLITS
from pcsr.data.dataset import Split
from pcsr.data.schema import Manifest
from pcsr.data.shards import read_manifest
from pcsr.errors import UserError
from pcsr.plugins.registry import Registry
from pcsr.recipe import PARTS, Recipe, from_resolved


@dataclass(frozen=True)
class BuiltData:
    """Folders that `pcsr data make` built, joined to one data set in this order."""

    folders: tuple[Path, ...]
    manifests: tuple[Manifest, ...]

    @classmethod
    def read(cls, folders: Sequence[Path]) -> "BuiltData":
        """Read the manifests of folders.

        Raises:
            UserError: a folder holds no data set or is named twice, or the folders' clouds differ in size.
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
        """Fingerprint of the folder; for several folders, a hash of their fingerprints in order."""
        if not self.joined:
            return self.manifests[0].fingerprint
        return hashlib.sha256(json.dumps(self.joined).encode()).hexdigest()

    @property
    def joined(self) -> tuple[str, ...]:
        """Fingerprints of the folders if there are several; empty for a single folder."""
        return tuple(one.fingerprint for one in self.manifests) if len(self.manifests) > 1 else ()

    def holders(self, split: str) -> list[int]:
        """Return the indices of the folders that have a split."""
        return [number for number, manifest in enumerate(self.manifests) if split in manifest.splits]

    def missing(self) -> list[str]:
        """Return a message for each folder that lacks a split which another folder has."""
        return [
            f"{folder} has no split '{split}': {manifest.empty.get(split, 'it is not finished')}"
            for split in SPLITS
            if self.holders(split)
            for folder, manifest in zip(self.folders, self.manifests, strict=True)
            if split not in manifest.splits
        ]

    def shards(self, split: str) -> list[Path]:
        """Return the files of a split, of all folders."""
        return [
            self.folders[number] / shard.file
            for number in self.holders(split)
            for shard in self.manifests[number].splits[split].shards
        ]

    def objects(self, split: str) -> int:
        """Return the number of objects of a split, over all folders."""
        return sum(self.manifests[number].splits[split].objects for number in self.holders(split))

    def split(self, split: str, advance: Callable[[int], None] = lambda count: None) -> Split:
        """Load a split from all folders that have it.

        Args:
            split: "train", "validation" or "test".
            advance: called with the number of objects that were just read and checked.

        Raises:
            UserError: no folder has the split, a file is damaged, or the clouds differ in size.
        """
        holders = self.holders(split) or [0]  # without any, loading it from the first folder raises the error
        whole = Split.joined([Split.load(self.folders[number], split, advance=advance) for number in holders])
        return dataclasses.replace(whole, about={**whole.about, "fingerprint": self.fingerprint})

    def card(self) -> list[dict[str, Any]]:
        """Return the description of the data for the card of weights: name, settings and sizes of each folder."""
        return [
            {
                "folder": folder.resolve().name,
                "fingerprint": manifest.fingerprint,
                "settings": manifest.data.model_dump(mode="json"),
                "objects": {split: about.objects for split, about in manifest.splits.items()},
            }
            for folder, manifest in zip(self.folders, self.manifests, strict=True)
        ]

    def replace_data(self, recipe: Recipe, registry: Registry) -> Recipe:
        """Return the recipe with the settings of this data set in place of its own, except the number of touches.

        The settings of several folders are those of the first with a split `test`; if the folders differ in their
        sampling, it is set to `mixed`.

        Raises:
            UserError: the recipe needs more touches than the data has, or meshes of several folders, or the data
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
        parts = PARTS.keys() - ({("train", "objective")} if recipe.weights else set())  # weights need no objective
        origin = f"{recipe.name} on {' and '.join(map(str, self.folders))}"
        replaced = from_resolved(plain, registry, origin, parts)
        # The data's fingerprint covers the code that built it; the present code of those parts does not matter.
        code = {key: value for key, value in replaced.code.items() if not key.startswith("data.")}
        return replaced.model_copy(update={"code": code})

    def _check_touches(self, recipe: Recipe) -> None:
        # `train.touches` matters only if the recipe is trained.
        needed = recipe.data.touches if recipe.weights else recipe.most_touches
        for folder, manifest in zip(self.folders, self.manifests, strict=True):
            has = manifest.data.touches
            if needed > has:
                raise UserError(
                    f"{folder} has {has} touches of each object, and '{recipe.name}' needs {needed}: "
                    f"build it with --set touches={needed}, or lower data.touches and train.touches"
                )

    def _check_meshes(self, recipe: Recipe, testing: Sequence[int], registry: Registry) -> None:
        """Check that the meshes, if the evaluation needs them, all come from the same shape source."""
        users = recipe.measured_on_meshes(registry)
        shapes = (self.manifests[number].data.shapes.model_dump(mode="json") for number in testing)
        sources = {json.dumps(one, sort_keys=True) for one in shapes}
        if users and len(sources) > 1:
            folders = " and ".join(str(self.folders[number]) for number in testing)
            raise UserError(
                f"'{users[0]}' needs the meshes, and the test objects of {folders} are from different shape sources: "
                f"evaluate on one of them, or remove '{users[0]}' from evaluate"
            )
