"""Recipes with finished weights: missing sections come from the weights' card, and the networks must agree."""

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
from pcsr.recipe.graft import load_network
from pcsr.recipe.merge import merge
from pcsr.recipe.part_keys import PARTS
from pcsr.recipe.schema import Model, Recipe
from pcsr.recipe.source import Keys, Location, Mistake, RecipeError, Source
from pcsr.weights import SHA256_IN_0_1, names
from pcsr.weights.file import read_card
from pcsr.weights.find import find


@dataclass(frozen=True)
class WeightsFile:
    """Weights file with the recipe of its card. The weights themselves are not read.

    Only the parts of the network must be installed, not those of the data and the training.
    """

    path: Path
    sha256: str
    """Hash of the file."""
    recipe: Recipe
    """Recipe of the weights' training."""
    identity: tuple[int, ...] | None
    """Identity of the hashed file, from `pcsr.files.identity`."""

    @classmethod
    def read(cls, path: Path, registry: Registry) -> "WeightsFile":
        """Read the card of a weights file and hash the file. The result is cached until the file changes.

        Raises:
            UserError: the file is not a weights file, its recipe is invalid here, or it changes while it is read.
        """
        return _read(path, identity(path), registry)

    def check_unchanged(self) -> None:
        """Check that the file has not changed since it was hashed.

        Raises:
            UserError: the file has changed.
        """
        if identity(self.path) != self.identity:
            raise UserError(f"the weights {self.path} have changed since they were checked: run it again")


@functools.lru_cache(maxsize=32)
def _read(path: Path, file: tuple[int, ...] | None, registry: Registry) -> WeightsFile:
    card = read_card(path)
    if not isinstance(card.get("recipe"), dict):
        raise UserError(f"{path} holds no recipe, so the network of its weights is unknown: use a file that pcsr wrote")
    try:
        recipe = check_card(card["recipe"], registry, f"recipe in {path}")
    except RecipeError as error:
        raise UserError("; ".join(map(str, error.mistakes))) from error
    weights_file = WeightsFile(path, sha256(path), recipe, file)
    weights_file.check_unchanged()
    return weights_file


def check_with_weights(source: Source, registry: Registry) -> Recipe:
    """Validate a recipe that may name weights.

    If it does, `train` is always that of the weights, and so are `model`, `patches` and `data.rate` if the recipe
    does not set them.

    Raises:
        RecipeError: the recipe has mistakes, or its network differs from that of the weights.
    """
    source = source.copy()
    load_network(source, registry)
    written = source.data.get("weights")
    if written is None:
        _name_start(source, registry)
        return check(source, registry)
    location = source.location(("weights", "use"))
    try:
        weights_file, named = _named(written, location, registry)
    except UserError as error:
        source.mistakes.append(Mistake(location, str(error)))
        del source.data["weights"]
        return check(source, registry)
    plain = weights_file.recipe.resolved()
    base = {section: plain[section] for section in ("model", "patches") if section not in source.data}
    base |= {"train": plain["train"], "data": {"rate": plain["data"]["rate"]}}
    merged = merge(Source(base, {(): source.values[()]}), source)
    merged.data["weights"] = named
    merged.data.pop("code", None)  # may contain the objective, which is not validated
    recipe = check(merged, registry, PARTS.keys() - {("train", "objective")})  # nothing is trained
    wrong = misfit(recipe, weights_file.recipe, registry)
    if wrong:
        keys, text = wrong
        raise RecipeError([Mistake(merged.location(keys), text)])
    return recipe.model_copy(update={"train": weights_file.recipe.train})


def _name_start(source: Source, registry: Registry) -> None:
    """Replace the name of the weights that training starts from by the resolved mapping, in place."""
    train = source.data.get("train")
    if not isinstance(train, dict) or train.get("start") is None:
        return
    location = source.location(("train", "start"))
    try:
        train["start"] = _named(train["start"], location, registry, "train.start")[1]
    except UserError as error:
        source.mistakes.append(Mistake(location, str(error)))
        del train["start"]


def _named(
    written: Any, location: Location, registry: Registry, key: str = "weights"
) -> tuple[WeightsFile, dict[str, Any]]:
    """Return the weights file that a recipe names at `key`, and the resolved mapping."""
    named = written if isinstance(written, dict) else {"use": written}
    use = named.get("use")
    if not isinstance(use, str) or not use:
        known = ", ".join(names())
        raise UserError(f"{key} must be shipped weights ({known}) or a file, got {json.dumps(written, default=str)}")
    # A path in a file is relative to that file; a path on the command line, to the current folder.
    path = find(use, Path(location.origin).parent if location.line else Path())
    weights_file = WeightsFile.read(path, registry)
    accepted = (weights_file.sha256, SHA256_IN_0_1.get(weights_file.sha256))
    if named.get("sha256", weights_file.sha256) not in accepted:
        raise UserError(
            f"the weights {path} have the hash {weights_file.sha256[:12]}…, but {key}.sha256 is "
            f"{str(named['sha256'])[:12]}…: get the file with this hash, or remove {key}.sha256"
        )
    return weights_file, {**named, "use": use if use in names() else str(path), "sha256": weights_file.sha256}


def check_weights(recipe: Recipe, registry: Registry) -> WeightsFile | None:
    """Return the weights file that a recipe names, or None if it names none.

    Raises:
        UserError: the hash, network or rate of the file differs from the recipe's.
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
    """Return the keys of the first difference between a recipe's network and that of its weights, and a message.

    Args:
        recipe: recipe that names the weights.
        trained: recipe of the weights' training.
        registry: installed parts; their traits include which upsamplers support any rate.

    Returns:
        Keys and message, or None if the networks agree.
    """
    different = _difference(_network(recipe), _network(trained), ())
    if different:
        keys, value, trained_value = different
        text = (
            f"{'.'.join(map(str, keys))} is {json.dumps(value)}, and the weights were trained with "
            f"{json.dumps(trained_value)}: leave out `{keys[0]}` to use that of the weights, or name other weights"
        )
        return keys, text
    rate, trained_rate = recipe.data.rate, trained.network_rate
    model = recipe.model
    any_rate = isinstance(model, Model) and Trait.ANY_RATE in registry.get("upsampler", model.upsampler.use).traits
    if recipe.patches is None and rate != trained_rate and not any_rate:  # patches are repeated
        text = f"data.rate is {rate}, and the weights have rate {trained_rate}"
        return ("data", "rate"), f"{text}: take `rate: {trained_rate}`, or name other weights"
    return None


def _network(recipe: Recipe) -> dict[str, Any]:
    """Return the sections that determine a network. The overlap of patches does not."""
    plain = recipe.resolved()
    patches = plain["patches"]
    return {"model": plain["model"], "patches": patches and {k: v for k, v in patches.items() if k != "overlap"}}


def _difference(one: Any, other: Any, keys: Keys) -> tuple[Keys, Any, Any] | None:
    """Return the keys of the first difference between two trees, with both values."""
    if not (isinstance(one, dict) and isinstance(other, dict)):
        return None if one == other else (keys, one, other)
    for key in dict.fromkeys([*one, *other]):
        found = _difference(one.get(key), other.get(key), (*keys, key))
        if found:
            return found
    return None
