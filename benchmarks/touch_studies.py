"""The rows of the studies in pcsr/recipes/touch, read from their run folders (docs/when-touch-helps.md)."""

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from pcsr.errors import UserError
from pcsr.metrics.touch_effect import TouchEffect
from pcsr.recipe.old_names import as_in_0_1
from pcsr.report.tables.scores import scaled
from pcsr.results import Results, read_results

METRIC = "cd"
NETWORK, SIZE, POLICY = "weights.use", "data.touch.object_size", "data.touch.policy"
SAMPLING, CAMERAS, CAMERA = "data.sampling", "data.view.cameras", "data.view.noise"
DEPTH, POSITION, ROTATION = (f"data.touch.{noise}_noise" for noise in ("depth", "position", "rotation"))
SHARED_POSITION, SHARED_ROTATION = (f"data.touch.noise.shared_{noise}_noise" for noise in ("position", "rotation"))
REGISTRATION, SEED = "data.registration", "data.seed"
HEADS = {
    NETWORK: "network",
    SIZE: "longest side, mm",
    POLICY: "policy",
    CAMERA: "camera noise, radii",
}
"""Of the columns that show what a study varies."""
ERRORS = (POSITION, ROTATION, SHARED_POSITION, SHARED_ROTATION)
SETTINGS = (*HEADS, SAMPLING, CAMERAS, DEPTH, *ERRORS, REGISTRATION, SEED)
STUDIES = {
    "size": (NETWORK, SIZE),
    "vision": (CAMERA,),
    "occlusion": (POLICY,),
    "sensor": (SAMPLING, CAMERAS, CAMERA, *ERRORS, DEPTH, REGISTRATION, SEED),
    "policy": (POLICY,),
}
"""What each study varies beside the number of touches. Its rows are called `study-…`."""
TOUCHES = 4
"""In the pictures and tables that are not over the number of touches."""
PLAIN, BESIDE = "without touch", ("midpoint", "floor")
Numbers = Float[np.ndarray, " k"]


@dataclass(frozen=True)
class Row:
    """One row of a study, on the objects that all rows of the same seed have. Chamfer distances are times `scale`."""

    name: str
    settings: dict[str, Any]
    """Of the keys in `SETTINGS`; errors that are not there are 0, and `REGISTRATION` is whether there is one."""
    weights: str
    """Their hash."""
    touches: int
    objects: tuple[str, ...]
    coverage: float
    """Of the objects' surface, in the mean of all objects of the row."""
    touched: Numbers
    plain: Numbers
    replaced: Numbers
    """Without touch, the touched region replaced by the truth."""
    beside: dict[str, float]
    """Means of the baselines."""
    effect: TouchEffect
    label: str
    """`cd ×10³`."""
    scale: float

    @property
    def change(self) -> float:
        """What touch changes in the mean; below 0 it helps."""
        return float((self.touched - self.plain).mean())

    @property
    def error(self) -> float:
        """Standard error of `change` over objects, which are their own controls; NaN for a single one."""
        count = len(self.plain)
        return float((self.touched - self.plain).std(ddof=1)) / math.sqrt(count) if count > 1 else math.nan


def read(runs: Path) -> dict[str, list[Row]]:
    """The rows of each study that was run, sorted by what is varied.

    Raises:
        UserError: there is none, two runs are the same row, networks of one name have other weights, or a run's
            results are malformed or of no touch.
    """
    found: dict[str, list[Results]] = defaultdict(list)
    paths: dict[str, Path] = {}
    for path in sorted(runs.glob("*/results.json")):
        results = read_results(path)
        study = results.name.partition("-")[0]
        if study not in STUDIES:
            continue
        if results.name in paths:
            raise UserError(f"{paths[results.name]} and {path} are both '{results.name}': delete the one that is old")
        paths[results.name] = path
        found[study].append(results)
    if not found:
        raise UserError(f"{runs} holds no run of a study: `pcsr run touch/size --runs {runs}` makes some")
    studies = {study: rows_of(found[study], STUDIES[study]) for study in STUDIES if study in found}
    known: dict[str, Row] = {}
    for row in (row for rows in studies.values() for row in rows):
        first = known.setdefault(row.settings[NETWORK], row)
        if first.weights != row.weights:
            raise UserError(
                f"'{first.name}' and '{row.name}' are by different weights '{row.settings[NETWORK]}' "
                f"({first.weights[:12]} and {row.weights[:12]}): delete the old runs and run their studies again"
            )
    return studies


def rows_of(runs: Sequence[Results], keys: Sequence[str]) -> list[Row]:
    """The rows of one study, sorted by the settings `keys` and the number of touches.

    Raises:
        UserError: a run has no touches, or no object is in all of those with the same seed of the data.
    """
    of_seed: dict[Any, list[Results]] = defaultdict(list)
    for run in runs:
        of_seed[_setting(run.recipe, SEED)].append(run)
    rows = []
    for some in of_seed.values():
        common = set.intersection(*(set(run.objects) for run in some))
        if not common:
            raise UserError(f"the runs {', '.join(run.name for run in some)} have no object in common: run them again")
        rows += [_row(run, [k for k, name in enumerate(run.objects) if name in common]) for run in some]
    return sorted(rows, key=lambda row: (*(row.settings[key] for key in keys), row.touches))


def own(rows: Sequence[Row]) -> list[Row]:
    """Those of the network that most rows are of: it was measured with every number of touches."""
    networks = [row.settings[NETWORK] for row in rows]
    most = max(networks, key=networks.count, default=None)
    return [row for row in rows if row.settings[NETWORK] == most]


def around(rows: Sequence[Row]) -> Row | None:
    """The row whose error is shown over the distance to the touches: four of them on the smallest objects."""
    return next((row for row in own(rows) if row.touches == TOUCHES), None)


def _row(run: Results, kept: Sequence[int]) -> Row:
    if run.touch is None or METRIC not in run.metrics or not run.recipe.get("weights"):
        raise UserError(f"run '{run.name}' has no touches, no {METRIC} or no weights: run its study again")
    scale = run.metrics[METRIC].scale
    recipe = as_in_0_1(run.recipe)  # which old runs have, and new ones can be brought into
    settings = {key: _setting(recipe, key) for key in SETTINGS}
    settings |= {key: settings[key] or 0.0 for key in (*ERRORS, CAMERA, DEPTH)}
    settings[REGISTRATION] = settings[REGISTRATION] is not None
    touched, plain, replaced = (
        scale * np.array(values)[kept] for values in (run.touch.touched, run.touch.plain, run.touch.replaced)
    )
    return Row(
        name=run.name,
        settings=settings | {NETWORK: Path(settings[NETWORK]).stem},
        weights=run.recipe["weights"]["sha256"],
        touches=run.data.touches,
        objects=tuple(run.objects[k] for k in kept),
        coverage=run.data.coverage or 0.0,
        touched=touched,
        plain=plain,
        replaced=replaced,
        beside={one.name: float(scale * np.array(one.values[METRIC])[kept].mean()) for one in run.methods[1:]},
        effect=run.touch,
        label=scaled(METRIC, scale),
        scale=scale,
    )


def _setting(recipe: dict[str, Any], key: str) -> Any:
    value: Any = recipe
    for part in key.split("."):
        value = value.get(part) if isinstance(value, dict) else None
    return value
