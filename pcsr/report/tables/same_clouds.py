"""Whether runs were measured on the same clouds, and what differs where they were not."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from pcsr.errors import UserError
from pcsr.results import Results
from pcsr.validation_messages import shortened

ROUNDING = 1e-4
"""Relative difference of the clouds' radii up to which they are equal: processors round differently."""
DESCRIBED = {"shapes", "split", "points", "truth", "sampling", "seed", "fingerprint"}
"""Fields of `pcsr.results.Data` that describe the clouds."""
LISTED = 4
"""Number of differences that a message names."""


def same_clouds(one: Results, other: Results) -> bool:
    """Whether two runs were measured on the same sparse and true clouds; touches may differ.

    Results of pcsr 0.2 and older have no radii of the clouds; there the settings of the data decide.
    """
    a, b = one.data, other.data
    if one.objects != other.objects or (a.points, a.truth) != (b.points, b.truth):
        return False
    if a.radii is not None and b.radii is not None:
        return len(a.radii) == len(b.radii) and np.allclose(a.radii, b.radii, rtol=ROUNDING)
    return (a.shapes, a.split, a.sampling, a.seed) == (b.shapes, b.split, b.sampling, b.seed)


def check_same_clouds(runs: Sequence[tuple[str, Results]]) -> None:
    """Check that all runs were measured on the same clouds by metrics of the same meaning.

    Args:
        runs: name, for messages, and results of each run.

    Raises:
        UserError: two runs differ; the message names the differences.
    """
    for (name, one), (other_name, other) in pairwise(runs):
        if not same_clouds(one, other):
            raise UserError(
                f"{other_name} was measured on other clouds than {name}: {_differences(one, other)}; "
                f"compare runs on the same test data"
            )
        for metric in one.metrics.keys() & other.metrics.keys():
            a, b = one.metrics[metric], other.metrics[metric]
            if a != b:
                raise UserError(
                    f"{other_name}: metric '{metric}' is '{b.description}' (×{b.scale:g}), in {name} it is "
                    f"'{a.description}' (×{a.scale:g}): evaluate both again with the same code"
                )


def check_same_settings(recipes: Sequence[tuple[str, dict[str, Any]]]) -> None:
    """Check the settings of recipes that decide the test clouds, before anything is trained.

    Equal settings are no proof of equal clouds; `check_same_clouds` compares the clouds after the runs.

    Args:
        recipes: name, for messages, and resolved recipe of each run.

    Raises:
        UserError: two recipes differ in such a setting.
    """
    for (name, one), (other_name, other) in pairwise(recipes):
        if different := _different(cloud_settings(one), cloud_settings(other)):
            raise UserError(
                f"{other_name} has other test data than {name}: {different}; give both the same, with --set or in "
                f"the recipes"
            )


def cloud_settings(recipe: dict[str, Any]) -> dict[str, Any]:
    """Return the settings of a resolved recipe that decide the sparse and true test clouds, by dotted key.

    Keys that the recipe lacks, as recipes of older versions do, are left out.
    """
    data, evaluate = recipe.get("data", {}), recipe.get("evaluate", {})
    keys = ["points", "rate", "truth", "sampling", *(["view"] if data.get("sampling") in ("view", "mixed") else [])]
    settings = {f"data.{key}": data[key] for key in keys if key in data}
    if isinstance(shapes := data.get("shapes"), dict):
        settings |= {f"data.shapes.{key}": shapes[key] for key in ("use", "held_out") if key in shapes}
    seed = recipe.get("seed") if data.get("seed") is None else data["seed"]
    if seed is not None:
        settings["data.seed"] = seed
    if "objects" in evaluate:
        settings["evaluate.objects"] = evaluate["objects"]
    return settings


def _differences(one: Results, other: Results) -> str:
    """Describe the differences between the test data of two runs."""
    found = _different(cloud_settings(one.recipe), cloud_settings(other.recipe))
    if found:
        return found
    a, b = ({"objects": len(run.objects), **run.data.model_dump(include=DESCRIBED)} for run in (one, other))
    return _different(a, b) or "the objects or their points"


def _different(one: dict[str, Any], other: dict[str, Any]) -> str:
    """Describe the keys that both have with different values; empty if there are none."""
    keys = [key for key in one if key in other and one[key] != other[key]]
    found = [f"{key} is {_shown(other[key])}, not {_shown(one[key])}" for key in keys]
    more = f" and {len(found) - LISTED} more" if len(found) > LISTED else ""
    return ", ".join(found[:LISTED]) + more


def _shown(value: Any) -> str:
    return "null" if value is None else shortened(str(value), 60)
