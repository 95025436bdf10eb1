"""Search for finished weights and results of a recipe, with the same code and data, or with earlier code."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcsr.errors import UserError
from pcsr.network.card import changed
from pcsr.plugins.code import own_code
from pcsr.plugins.registry import FIRST_PARTY, Registry
from pcsr.recipe import Recipe
from pcsr.recipe.pretrained import check_weights
from pcsr.run_files import FinishedRun, read_run
from pcsr.weights import WEIGHTS, names, shipped
from pcsr.weights.file import read_card


@dataclass(frozen=True)
class EarlierWeights:
    """Weights of a recipe that were trained before the code of a part changed."""

    path: Path
    parts: str
    """Parts whose code has changed, in words."""
    recorded: bool
    """Whether the card identifies the code that the weights were trained with; cards of pcsr 0.1.0 do not."""

    def __str__(self) -> str:
        run = self.path.parent
        if self.recorded:
            return f"the code of {self.parts} has changed since {run} was trained"
        return f"{run} was trained by a version of pcsr that did not record the code of {self.parts}"


def of_recipe(recipe: Recipe, data: str, runs: Path, folder: Path) -> tuple[Path, str] | None:
    """Find finished weights of exactly this recipe, its code and its data.

    Args:
        recipe: recipe to run.
        data: fingerprint of its data.
        runs: folder of the run folders. One of another name, or for another number of touches at evaluation, may hold
            weights of the same recipe.
        folder: run folder of the recipe.

    Returns:
        The path of the weights and a description of their origin, or None if there are none.
    """
    same_fingerprint = sorted(runs.glob(f"*-{recipe.fingerprint[:8]}/{WEIGHTS}"))
    for path, source in (
        (folder / WEIGHTS, "this run folder"),
        *((shipped(name), "shipped weights") for name in names()),
        *((path, "another run of this recipe") for path in same_fingerprint),
    ):
        if path.exists():
            card = read_card(path)
            if card.get("fingerprint") == recipe.fingerprint and card.get("data_fingerprint") == data:
                return path, source
    return None


def of_other_code(recipe: Recipe, data: str, runs: Path, registry: Registry) -> EarlierWeights | None:
    """Find the newest weights of this recipe that were trained with other code of a part.

    Weights trained on other data count only if the code of a part that builds the data has changed.

    Args:
        recipe: recipe to run.
        data: fingerprint of its data.
        runs: folder of the run folders.
        registry: installed parts.
    """
    newest = sorted(runs.glob(f"*/{WEIGHTS}"), key=lambda path: (path.stat().st_mtime, path), reverse=True)
    for path, card in _cards(newest):
        settings = card.get("settings_fingerprint", card.get("fingerprint"))
        if settings != recipe.settings_fingerprint:
            continue
        parts = changed(recipe, card.get("recipe"), registry)
        if parts and (card.get("data_fingerprint") == data or any(key.startswith("data.") for key in parts)):
            return EarlierWeights(path, " and ".join(parts.values()), "settings_fingerprint" in card)
    return None


def finished_results(recipe: Recipe, registry: Registry, data: str, runs: Path, folder: Path) -> FinishedRun | None:
    """Read the results of a run folder if they are of exactly this recipe, its data, its weights and the code of pcsr.

    Args:
        recipe: recipe to run.
        registry: installed parts.
        data: fingerprint of its data.
        runs: folder of the run folders.
        folder: run folder of the recipe.

    Returns:
        The finished run; None if there is none, or if metrics or baselines are third-party parts, whose code results
        do not record.
    """
    parts = [("metric", name) for name in recipe.evaluate.metrics] + [
        ("baseline", name) for name in recipe.evaluate.baselines
    ]
    if any(registry.entries[part].owner != FIRST_PARTY for part in parts if part in registry.entries):
        return None
    named = check_weights(recipe, registry)
    found = of_recipe(recipe, data, runs, folder) if named is None else (named.path, "")
    try:
        done = read_run(folder)
        weights = None if found is None else read_card(found[0]).get("sha256")
    except UserError:
        return None
    results = done.results
    measured = (results.recipe, results.data.fingerprint, results.training.weights, results.code)
    wanted = (json.loads(json.dumps(recipe.resolved())), data, weights, own_code())
    return done if weights is not None and measured == wanted else None


def _cards(paths: list[Path]) -> Iterator[tuple[Path, dict[str, Any]]]:
    for path in paths:
        try:
            yield path, read_card(path)
        except UserError:  # a damaged file, or one that is not of pcsr
            continue
