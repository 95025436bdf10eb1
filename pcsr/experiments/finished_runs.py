"""Finished weights of a recipe: those of exactly its code and data, and those that other code left."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcsr import weights
from pcsr.errors import UserError
from pcsr.network.load import read_card
from pcsr.network.origins import changed
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe

WEIGHTS = "weights.safetensors"


@dataclass(frozen=True)
class Earlier:
    """Weights of a recipe that were trained before the code of a part changed."""

    path: Path
    parts: str
    """Whose code it is, in words."""
    noted: bool
    """Whether their card says of which code they are; those of pcsr 0.1.0 do not."""

    def __str__(self) -> str:
        run = self.path.parent
        if self.noted:
            return f"the code of {self.parts} has changed since {run} was trained"
        return f"{run} was trained by a version of pcsr that did not note the code of {self.parts}"


def of_recipe(recipe: Recipe, data: str, runs: Path, folder: Path) -> tuple[Path, str] | None:
    """Finished weights of exactly this recipe, its code and its data, and where they come from.

    Args:
        recipe: as it is run.
        data: the fingerprint of its data.
        runs: where run folders are. Under another name, or for another number of touches at evaluation, the same
            recipe may be trained already.
        folder: of this run.
    """
    alike = sorted(runs.glob(f"*-{recipe.fingerprint[:8]}/{WEIGHTS}"))
    for path, source in (
        (folder / WEIGHTS, "this run folder"),
        *((weights.shipped(name), "shipped weights") for name in weights.names()),
        *((path, "another run of this recipe") for path in alike),
    ):
        if path.exists():
            card = read_card(path)
            if card.get("fingerprint") == recipe.fingerprint and card.get("data_fingerprint") == data:
                return path, source
    return None


def of_other_code(recipe: Recipe, data: str, runs: Path, registry: Registry) -> Earlier | None:
    """The newest weights of this recipe that were trained with other code of a part.

    Their data may be other than now only if a part of other code made it.

    Args:
        recipe: as it is run.
        data: the fingerprint of its data.
        runs: where run folders are.
        registry: who brings the parts now.
    """
    newest = sorted(runs.glob(f"*/{WEIGHTS}"), key=lambda path: (path.stat().st_mtime, path), reverse=True)
    for path, card in _cards(newest):
        settings = card.get("settings_fingerprint", card.get("fingerprint"))
        if settings != recipe.settings_fingerprint:
            continue
        parts = changed(recipe, card.get("recipe"), registry)
        if parts and (card.get("data_fingerprint") == data or any(place.startswith("data.") for place in parts)):
            return Earlier(path, " and ".join(parts.values()), "settings_fingerprint" in card)
    return None


def _cards(paths: list[Path]) -> Iterator[tuple[Path, dict[str, Any]]]:
    for path in paths:
        try:
            yield path, read_card(path)
        except UserError:  # what somebody else has put there, or a damaged one, is not what is looked for
            continue
