"""What a network of pcsr/recipes/fusions/study.yaml makes of touches after each step of `train.snapshots`.

Each snapshot of a run is measured on all test objects. The numbers are kept in the run's folder (`snapshots.json`).
"""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Self

import torch
from pydantic import BaseModel, Field, FiniteFloat, TypeAdapter, ValidationError, model_validator

from pcsr.data.dataset import Split
from pcsr.data.sample import covered_points
from pcsr.errors import UserError
from pcsr.files import write_text
from pcsr.metrics.chamfer import chamfer
from pcsr.metrics.touch_effect import replace_region
from pcsr.network.load import load_weights
from pcsr.network.network import Network
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe
from pcsr.run_files import snapshot_file
from pcsr.tensors import CloudArray
from pcsr.upsample import upsample_as
from pcsr.validation_messages import explained
from pcsr.weights.file import read_card

MEASURED = "snapshots.json"
Numbers = Mapping[str, Annotated[list[FiniteFloat], Field(min_length=1)]]
"""Chamfer distance of each test object: `without` touch, with its `own` touches, with those of an `other` object, and
`replaced`: without touch, the touched region replaced by the truth. `moved` is that of the network's own two results,
without touch and with touches. `features` is without touch, with the encoder's features of another object."""
NAMES = ("without", "own", "other", "replaced", "moved", "features")
"""What is measured of each object."""


class Measured(BaseModel):
    """The numbers of a snapshot."""

    sha256: str
    """Hash of its weights."""
    cd: Numbers

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        if set(self.cd) != set(NAMES) or len({len(each) for each in self.cd.values()}) > 1:
            raise ValueError(f"it must have {', '.join(NAMES)}, each of all objects")
        return self


FILE = TypeAdapter(dict[str, Measured])
"""The numbers of a run's snapshots, by the names of their files."""


def measure(network: Network, recipe: Recipe, split: Split) -> Numbers:
    """Upsample each object of a split without touch, with its touches and with those of the next object.

    Without touch it is also upsampled with the encoder's features of the next object, which shows whether the network
    uses features at all.
    """
    numbers: dict[str, list[float]] = {name: [] for name in NAMES}
    touches = [list(some[: recipe.data.touches].numpy()) for some in split.touches]
    features: list[torch.Tensor] = []
    with network.encoder.register_forward_hook(lambda module, given, made: features.append(made)):
        without = [_dense(network, recipe, points, []) for points in split.points]
    for i, truth in enumerate(split.truth):
        following = (i + 1) % len(split)
        clouds = {"without": without[i]}
        for name, some in (("own", touches[i]), ("other", touches[following])):
            clouds[name] = _dense(network, recipe, split.points[i], some)
        of_other = features[following]
        with network.encoder.register_forward_hook(lambda module, given, made, of_other=of_other: of_other):
            clouds["features"] = _dense(network, recipe, split.points[i], [])
        region = torch.from_numpy(covered_points(truth.numpy(), touches[i]).any(0))
        clouds["replaced"] = replace_region(clouds["without"], truth, region)
        for name, cloud in clouds.items():
            numbers[name].append(_error(cloud, truth))
        numbers["moved"].append(_error(clouds["own"], clouds["without"]))
    return numbers


def _error(cloud: torch.Tensor, truth: torch.Tensor) -> float:
    """Chamfer distance, to the digits that a file needs."""
    return float(f"{float(chamfer(cloud[None], truth[None])[0]):.6g}")


def _dense(network: Network, recipe: Recipe, points: torch.Tensor, touches: Sequence[CloudArray]) -> torch.Tensor:
    """Upsample a cloud as the recipe does."""
    return torch.from_numpy(upsample_as(recipe, network, points.numpy(), touches)).float()


def measured(folder: Path, steps: Sequence[int], registry: Registry) -> dict[int, Numbers]:
    """Return the numbers of a run's snapshots by step, after measuring those that are new.

    Numbers stay when the weights are removed.

    Raises:
        UserError: the file of the numbers is malformed.
    """
    path = folder / MEASURED
    known = _known(path)
    by_step = {}
    for step in steps:
        weights = folder / snapshot_file(step)
        entry = known.get(weights.name)
        card = read_card(weights) if weights.exists() else None
        if card is not None and (entry is None or entry.sha256 != card["sha256"]):
            network, recipe, _ = load_weights(weights, registry)
            split = _test_split(folder.parent / "data" / card["data_fingerprint"][:12])
            known[weights.name] = entry = Measured(sha256=card["sha256"], cd=measure(network, recipe, split))
            write_text(path, FILE.dump_json(known).decode())
        if entry is not None:
            by_step[step] = entry.cd
    return by_step


def _known(path: Path) -> dict[str, Measured]:
    """Read the numbers that a run's folder has; none without the file.

    Raises:
        UserError: the file is malformed.
    """
    if not path.exists():
        return {}
    try:
        return FILE.validate_python(json.loads(path.read_bytes()))
    except ValueError as error:
        first = error.errors()[:1] if isinstance(error, ValidationError) else []
        what = ": ".join([*map(str, first[0]["loc"]), explained(first)]) if first else f"it is no JSON ({error})"
        raise UserError(f"{path}: {what}; remove the file, and the snapshots are measured again") from error


@cache
def _test_split(folder: Path) -> Split:
    return Split.load(folder, "test")
