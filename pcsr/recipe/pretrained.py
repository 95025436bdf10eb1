"""A recipe with `weights`: what they were trained as goes under it, and both must mean one network."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pcsr import weights
from pcsr.contracts import Trait
from pcsr.errors import UserError
from pcsr.files import sha256
from pcsr.plugins.registry import Registry
from pcsr.recipe.check import check, check_card
from pcsr.recipe.merge import merge
from pcsr.recipe.part_keys import PARTS
from pcsr.recipe.schema import Recipe
from pcsr.recipe.source import Keys, Mistake, Place, RecipeError, Source
from pcsr.weights.file import read_file


@dataclass(frozen=True)
class Trained:
    """Finished weights, and what their card says of them; the weights themselves are not read.

    Only the parts of the network need be here: those of the data and the training are what the card says of them.
    """

    path: Path
    sha256: str
    """Hash of the file."""
    recipe: Recipe
    """That they were trained by."""

    @classmethod
    def read(cls, path: Path, registry: Registry) -> "Trained":
        """Look into a weights file.

        Raises:
            UserError: it is no weights file, or its recipe means nothing here.
        """
        card = read_file(path, tensors=False)[1]
        if not isinstance(card.get("recipe"), dict):
            raise UserError(f"{path} holds no recipe, so nobody knows which network its weights are of")
        try:
            recipe = check_card(card["recipe"], registry, f"recipe in {path}")
        except RecipeError as error:
            raise UserError("; ".join(map(str, error.mistakes))) from error
        return cls(path, sha256(path), recipe)


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
    place = source.place(("weights", "use"))
    try:
        trained, named = _named(written, place, registry)
    except UserError as error:
        source.mistakes.append(Mistake(place, str(error)))
        del source.data["weights"]
        return check(source, registry)
    plain = trained.recipe.resolved()
    under = {section: plain[section] for section in ("model", "patches") if section not in source.data}
    under |= {"train": plain["train"], "data": {"rate": plain["data"]["rate"]}}
    laid = merge(Source(under, {(): source.values[()]}), source)
    laid.data["weights"] = named
    laid.data.pop("code", None)  # of an objective that is not looked at
    recipe = check(laid, registry, PARTS.keys() - {("train", "objective")})  # nothing is trained
    wrong = misfit(recipe, trained.recipe, registry)
    if wrong:
        keys, text = wrong
        raise RecipeError([Mistake(laid.place(keys), text)])
    return recipe.model_copy(update={"train": trained.recipe.train})


def _named(written: Any, place: Place, registry: Registry) -> tuple[Trained, dict[str, Any]]:
    """The weights that a recipe names, and the resolved form of that."""
    named = written if isinstance(written, dict) else {"use": written}
    use = named.get("use")
    if not isinstance(use, str) or not use:
        known = ", ".join(weights.names())
        raise UserError(f"weights are shipped ones ({known}) or a file, got {json.dumps(written, default=str)}")
    # A line of a file: relative to that file; an option of the command line: to where we are.
    path = weights.found(use, Path(place.origin).parent if place.line else Path())
    trained = Trained.read(path, registry)
    if named.get("sha256", trained.sha256) != trained.sha256:
        raise UserError(
            f"the weights {path} are not those of this recipe: their hash is {trained.sha256[:12]}…, and it says "
            f"{str(named['sha256'])[:12]}…: get those, or remove weights.sha256"
        )
    return trained, {**named, "use": use if use in weights.names() else str(path), "sha256": trained.sha256}


def check_weights(recipe: Recipe, registry: Registry) -> Trained | None:
    """The weights of a recipe, which must be those of its hash, of its network, and for the rate of its data.

    Raises:
        UserError: they are not.
    """
    if recipe.weights is None:
        return None
    path = weights.found(recipe.weights.use)
    trained = Trained.read(path, registry)
    if trained.sha256 != recipe.weights.sha256:
        raise UserError(f"the weights {path} have changed since the recipe '{recipe.name}' was read: run it again")
    wrong = misfit(recipe, trained.recipe, registry)
    if wrong:
        raise UserError(f"recipe '{recipe.name}': {wrong[1]}")
    return trained


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
