"""Recipes that name weights: the recipe in the card fills what they leave out, and both must mean one network."""

import functools
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcsr.contracts import Trait
from pcsr.errors import UserError
from pcsr.files import identity, sha256
from pcsr.plugins.registry import Registry
from pcsr.recipe.check import check, check_card
from pcsr.recipe.merge import merge
from pcsr.recipe.part_keys import PARTS
from pcsr.recipe.schema import Recipe
from pcsr.recipe.source import Keys, Location, Mistake, RecipeError, Source
from pcsr.weights import names
from pcsr.weights.file import read_card
from pcsr.weights.find import find


@dataclass(frozen=True)
class WeightsFile:
    """A file of finished weights and the recipe in its card; the weights themselves are not read.

    Only the parts of the network must be installed, not those of the data and the training.
    """

    path: Path
    sha256: str
    """Hash of the file."""
    recipe: Recipe
    """The recipe that the weights were trained by."""
    identity: tuple[int, ...] | None
    """Of the file that was hashed, as `pcsr.files.identity` gives it."""

    @classmethod
    def read(cls, path: Path, registry: Registry) -> "WeightsFile":
        """Read the card of a weights file and hash the file; in one process once, unless the file changes.

        Raises:
            UserError: it is no weights file, its recipe means nothing here, or it changes meanwhile.
        """
        return _read(path, identity(path), registry)

    def check_unchanged(self) -> None:
        """Refuse a file that is another than the one that was hashed.

        Raises:
            UserError: it is another.
        """
        if identity(self.path) != self.identity:
            raise UserError(f"the weights {self.path} have changed since they were checked: run it again")


@functools.lru_cache(maxsize=32)
def _read(path: Path, file: tuple[int, ...] | None, registry: Registry) -> WeightsFile:
    card = read_card(path)
    if not isinstance(card.get("recipe"), dict):
        raise UserError(f"{path} holds no recipe, so nobody knows which network its weights are of")
    try:
        recipe = check_card(card["recipe"], registry, f"recipe in {path}")
    except RecipeError as error:
        raise UserError("; ".join(map(str, error.mistakes))) from error
    weights_file = WeightsFile(path, sha256(path), recipe, file)
    weights_file.check_unchanged()
    return weights_file


def check_with_weights(source: Source, registry: Registry) -> Recipe:
    """The recipe that a source describes, which may name weights.

    Of such a recipe `train` is that of the weights, whatever it says, and so are `model`, `patches` and `data.rate` if
    it says nothing of them.

    Raises:
        RecipeError: it has mistakes, or means another network than its weights.
    """
    written = source.data.get("weights")
    if written is None:
        return check(source, registry)
    source = source.copy()
    location = source.location(("weights", "use"))
    try:
        weights_file, named = _named(written, location, registry)
    except UserError as error:
        source.mistakes.append(Mistake(location, str(error)))
        del source.data["weights"]
        return check(source, registry)
    plain = weights_file.recipe.resolved()
    under = {section: plain[section] for section in ("model", "patches") if section not in source.data}
    under |= {"train": plain["train"], "data": {"rate": plain["data"]["rate"]}}
    laid = merge(Source(under, {(): source.values[()]}), source)
    laid.data["weights"] = named
    laid.data.pop("code", None)  # of an objective that is not looked at
    recipe = check(laid, registry, PARTS.keys() - {("train", "objective")})  # nothing is trained
    wrong = misfit(recipe, weights_file.recipe, registry)
    if wrong:
        keys, text = wrong
        raise RecipeError([Mistake(laid.location(keys), text)])
    return recipe.model_copy(update={"train": weights_file.recipe.train})


def _named(written: Any, location: Location, registry: Registry) -> tuple[WeightsFile, dict[str, Any]]:
    """The weights that a recipe names, and the resolved form of that."""
    named = written if isinstance(written, dict) else {"use": written}
    use = named.get("use")
    if not isinstance(use, str) or not use:
        known = ", ".join(names())
        raise UserError(f"weights are shipped ones ({known}) or a file, got {json.dumps(written, default=str)}")
    # A line of a file: relative to that file; an option of the command line: to where we are.
    path = find(use, Path(location.origin).parent if location.line else Path())
    weights_file = WeightsFile.read(path, registry)
    if named.get("sha256", weights_file.sha256) != weights_file.sha256:
        raise UserError(
            f"the weights {path} are not those of this recipe: their hash is {weights_file.sha256[:12]}…, and it says "
            f"{str(named['sha256'])[:12]}…: get those, or remove weights.sha256"
        )
    return weights_file, {**named, "use": use if use in names() else str(path), "sha256": weights_file.sha256}


def check_weights(recipe: Recipe, registry: Registry) -> WeightsFile | None:
    """The weights file that a recipe names, or None; its hash, network and rate must be the recipe's.

    Raises:
        UserError: they are not.
    """
    if recipe.weights is None:
        return None
    path = find(recipe.weights.use)
    weights_file = WeightsFile.read(path, registry)
    if weights_file.sha256 != recipe.weights.sha256:
        raise UserError(f"the weights {path} have changed since the recipe '{recipe.name}' was read: run it again")
    wrong = misfit(recipe, weights_file.recipe, registry)
    if wrong:
        raise UserError(f"recipe '{recipe.name}': {wrong[1]}")
    return weights_file


def misfit(recipe: Recipe, trained: Recipe, registry: Registry) -> tuple[Keys, str] | None:
    """The first thing in which a recipe wants another network than weights are of: where it stands, and what it is.

    Args:
        recipe: that names the weights.
        trained: by which they were trained.
        registry: knows which upsamplers serve any rate.
    """
    different = _difference(_network(recipe), _network(trained), ())
    if different:
        keys, ours, theirs = different
        text = (
            f"{'.'.join(map(str, keys))} is {json.dumps(ours)}, and the weights were trained with "
            f"{json.dumps(theirs)}: leave out `{keys[0]}`, which is then that of the weights, or name other weights"
        )
        return keys, text
    rate, able = recipe.data.rate, trained.network_rate
    any_rate = Trait.ANY_RATE in registry.get("upsampler", recipe.model.upsampler.use).traits
    if recipe.patches is None and rate != able and not any_rate:  # by patches it is applied again and again
        text = f"data.rate is {rate}, and the weights make {able} points of each: take `rate: {able}`, or other weights"
        return ("data", "rate"), text
    return None


def _network(recipe: Recipe) -> dict[str, Any]:
    """What decides a network; how often patches cover a cloud does not."""
    plain = recipe.resolved()
    patches = plain["patches"]
    return {"model": plain["model"], "patches": patches and {k: v for k, v in patches.items() if k != "overlap"}}


def _difference(one: Any, other: Any, keys: Keys) -> tuple[Keys, Any, Any] | None:
    """The first place at which two trees differ, and what stands there in each."""
    if not (isinstance(one, dict) and isinstance(other, dict)):
        return None if one == other else (keys, one, other)
    for key in dict.fromkeys([*one, *other]):
        found = _difference(one.get(key), other.get(key), (*keys, key))
        if found:
            return found
    return None
