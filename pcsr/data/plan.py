"""Plan of a data set: the objects of every split, and a fingerprint of everything that determines the data."""

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcsr.contracts import SPLITS, ShapeSource, TouchSource
from pcsr.errors import UserError
from pcsr.extras import require
from pcsr.plugins.registry import Registry
from pcsr.recipe import PartSpec, Recipe
from pcsr.recipe.old_names import part_as_in_0_1

FORMAT = 1
"""Version of the file format. A new version changes every fingerprint."""
REGISTRATION = 1
"""Version of `pcsr.registration`. A new version changes the fingerprints of data with registered touches."""
SEEN = ("view", "mixed")
"""Samplings of a camera's view, which need ray casting."""


@dataclass(frozen=True)
class Plan:
    """Plan of a data set. Any process can build parts of it, or resume an interrupted build."""

    recipe: Recipe
    """Recipe of the data."""
    files: tuple[Path, ...]
    """Plugin files that every process has to load."""
    names: dict[str, Sequence[str]]
    """Names of objects by split. Splits without objects are missing."""
    empty: dict[str, str]
    """Reasons by split for splits without objects."""
    fingerprint: str
    """Hash of the data, independent of folder, machine and number of processes."""

    @classmethod
    def of(cls, recipe: Recipe, registry: Registry) -> "Plan":
        """Create the plan of a recipe's data.

        Raises:
            UserError: no split has objects, or a package that the build needs is not installed.
        """
        require(packages(recipe, registry))
        shapes: ShapeSource = recipe.data.shapes.build(registry, "shapes")
        source: TouchSource = recipe.data.touch.build(registry, "touch")
        names: dict[str, Sequence[str]] = {}
        empty: dict[str, str] = {}
        for split in SPLITS:
            try:
                found = shapes.names(split)
            except UserError as error:
                found, empty[split] = [], str(error)
            if found:
                names[split] = found
            else:
                empty.setdefault(split, f"shapes '{recipe.data.shapes.use}' have no object in the split '{split}'")
        if not names:
            raise UserError("; ".join(dict.fromkeys(empty.values())))
        data = recipe.data.model_dump(mode="json")
        decisive = {
            "format": FORMAT,
            "seed": recipe.data_seed,
            "data": {key: data[key] for key in ("points", "rate", "truth", "sampling")},
            "view": data["view"] if recipe.data.sampling in ("view", "mixed") else None,
            "touches": recipe.most_touches,
            "touch": _decisive(recipe.data.touch, source),
            "shapes": [recipe.data.shapes.use, shapes.version],
            "objects": {
                split: [[name, shapes.digest(name), source.digest(name)] for name in some]
                for split, some in names.items()
            },
        }
        if recipe.data.registration and recipe.most_touches:
            decisive["registration"] = {"version": REGISTRATION, **data["registration"]}
        code = {key: code for key, code in recipe.code.items() if key.startswith("data.")}
        if code:  # of third-party parts
            decisive["code"] = code
        text = json.dumps(decisive, sort_keys=True)
        return cls(recipe, registry.files, names, empty, hashlib.sha256(text.encode()).hexdigest())

    def split(self, split: str) -> Sequence[str]:
        """Return the names of the objects of a split.

        Raises:
            UserError: the split has no objects. The message gives the reason.
        """
        if split not in self.names:
            raise UserError(self.empty[split])
        return self.names[split]


def packages(recipe: Recipe, registry: Registry) -> dict[str, str]:
    """Return the packages that building a recipe's data needs, with the reason for each."""
    data = recipe.data
    needed = data.shapes.needs(registry, "shapes")
    if data.sampling in SEEN:
        needed |= {"embreex": f"sampling: {data.sampling}"}
    if recipe.most_touches:
        needed |= data.touch.needs(registry, "touch")
    return needed


def _decisive(spec: PartSpec, part: TouchSource) -> dict[str, Any]:
    plain = spec.model_dump(mode="json")
    options = {key: value for key, value in plain["options"].items() if key not in part.path_options}
    old = part_as_in_0_1("touch", {"use": spec.use, **options})
    return {"use": old.pop("use"), "version": part.version, "options": old}
