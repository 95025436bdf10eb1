"""Search for finished weights of a recipe, trained with the same code and data, or with earlier code."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcsr.errors import UserError
from pcsr.network.card import changed
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe
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


def _cards(paths: list[Path]) -> Iterator[tuple[Path, dict[str, Any]]]:
    for path in paths:
        try:
            yield path, read_card(path)
        except UserError:  # a damaged file, or one that is not of pcsr
            continue
