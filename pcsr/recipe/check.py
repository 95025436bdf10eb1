"""Validation of recipes, which reports all mistakes at once, each with its location in the file and a remedy."""

import copy
import json
from collections.abc import Callable, Collection
from typing import Any, TypeGuard

from pydantic import BaseModel, ValidationError

from pcsr.errors import UserError
from pcsr.plugins.part_choice import PartChoice
from pcsr.plugins.registry import Registry
from pcsr.recipe.contradictions import contradictions
from pcsr.recipe.graft import NETWORK_PART, network_code, network_mistakes
from pcsr.recipe.merge import merge
from pcsr.recipe.mistakes import mistakes_of
from pcsr.recipe.old_names import modernize
from pcsr.recipe.optimizers import optimizer_options
from pcsr.recipe.part_keys import MODEL, NAMES, NETWORK_KEYS, PART_LISTS, PARTS, is_graft, owner_of
from pcsr.recipe.schema import (
    DEFAULTS,
    GRAFT_DEFAULTS,
    Evaluate,
    Recipe,
    options_model,
)
from pcsr.recipe.source import Keys, Location, Mistake, RecipeError, Source


def check(source: Source, registry: Registry, parts: Collection[Keys] = PARTS.keys()) -> Recipe:
    """Validate the data of a recipe.

    Args:
        source: data of the recipe, with the locations of its values.
        registry: installed parts.
        parts: keys of `PARTS` whose parts are checked. A part at another key need not be installed, and keeps its
            options unchecked.

    Raises:
        RecipeError: the recipe has mistakes; it holds all of them.
    """
    source = _with_defaults(source)
    modernize(source)
    data = source.data
    mistakes: list[Mistake] = []
    trains = ("train", "objective") in parts
    for keys, kind in PARTS.items():
        section, key = owner_of(data, keys), str(keys[-1])
        if section is not None and key in section and not (key == "touch_encoder" and section[key] is None):
            written = section[key]
            if keys in parts or not _is_part(written):
                section[key] = _part(source, registry, keys, kind, written, mistakes)
            else:
                section[key] = _unchecked(written)
    if is_graft(data) and NETWORK_PART in parts:
        mistakes += network_mistakes(source, registry)
    if isinstance(data.get("train"), dict):
        _check_training(source, registry, data["train"], trains, mistakes)
    data["code"] = _code(data, registry, parts)
    if set(parts) == PARTS.keys():
        mistakes += _unknown_names(source, registry)
    recipe: Recipe | None = None
    try:
        recipe = Recipe.model_validate(data)
    except ValidationError as error:
        mistakes += mistakes_of(error, data, Recipe, (), lambda keys, name: source.location(keys, of_name=name))
    # One mistake for each location: a value that could not be read has the wrong type too.
    unread = {mistake.location for mistake in source.mistakes}
    mistakes = [*source.mistakes, *(mistake for mistake in mistakes if mistake.location not in unread)]
    if recipe is not None and not mistakes:
        mistakes = contradictions(source, recipe, registry, trains=trains)
    if mistakes or recipe is None:
        raise RecipeError(mistakes)
    return recipe


def check_card(written: dict[str, Any], registry: Registry, origin: str) -> Recipe:
    """Validate the recipe in the card of weights, as far as inference needs it.

    The parts of the network are checked and must be installed. Those of the data and the training are not checked. A
    section `evaluate` that this version cannot read is dropped.

    Args:
        written: result of `Recipe.resolved` from the time when the weights were written.
        registry: installed parts.
        origin: name of the recipe's source in messages.

    Raises:
        RecipeError: the recipe has mistakes, or names parts or options of the network that are not installed.
    """
    source = Source(copy.deepcopy(written), {(): Location(origin)})
    modernize(source)
    try:
        Evaluate.model_validate(source.data.get("evaluate", {}))
    except ValidationError:
        del source.data["evaluate"]
    return check(source, registry, MODEL)


def _with_defaults(source: Source) -> Source:
    defaults = {section: parts for section, parts in DEFAULTS.items() if section not in source.data}
    defaults |= {section: DEFAULTS[section] for section in ("data", "train")}
    if is_graft(source.data) and isinstance(source.data["model"]["graft"], dict):
        defaults["model"] = {"graft": GRAFT_DEFAULTS}
    return merge(Source(defaults, {(): source.values[()]}), source)


def _check_training(
    source: Source, registry: Registry, train: dict[str, Any], trains: bool, mistakes: list[Mistake]
) -> None:
    """Replace the loggers and the optimizer of `train` by their specifications, in place.

    Args:
        source: the whole recipe.
        registry: installed parts.
        train: section of the recipe.
        trains: whether the recipe is trained. If it is not, names and options are not checked.
        mistakes: list to which mistakes are added.
    """
    for keys, kind in PART_LISTS.items():
        parts = train.get(str(keys[1]))
        if isinstance(parts, list):
            train[str(keys[1])] = [
                _part(source, registry, (*keys, index), kind, part, mistakes) if trains else _unchecked(part)
                for index, part in enumerate(parts)
            ]
    optimizer = train.get("optimizer")
    if trains and _is_part(optimizer):
        checked = _spec(source, ("train", "optimizer"), "optimizer", optimizer, mistakes, optimizer_options)
        # Only options that are given belong to the recipe, since other versions of torch may have further ones.
        options = {key: value for key, value in checked["options"].items() if key in optimizer}
        train["optimizer"] = {**checked, "options": options}
    elif optimizer is not None:
        train["optimizer"] = _unchecked(optimizer)


def _unchecked(written: Any) -> Any:
    """Return the specification of a part whose options are not checked; anything else as it is."""
    return {"use": written["use"], "options": _options(written)} if _is_part(written) else written


def _part(
    source: Source, registry: Registry, keys: Keys, kind: str, written: Any, mistakes: list[Mistake]
) -> dict[str, Any]:
    """Return the specification of a part with all its options; add its mistakes to `mistakes`."""
    if not _is_part(written):
        example = next(iter(registry.names(kind)), "name")
        key = "-" if isinstance(keys[-1], int) else f"{keys[-1]}:"
        text = f"{'.'.join(map(str, keys))}: name the part, as `{key} {example}` or with `use:`"
        mistakes.append(Mistake(source.location(keys), text))
        return {"use": "", "options": {}}
    spec = _spec(source, keys, kind, written, mistakes, lambda name: options_model(registry.get(kind, name)))
    for option, value in spec["options"].items():
        if isinstance(value, PartChoice):
            spec["options"][option] = _inner_part(source, registry, (*keys, option), value, mistakes)
    return spec


def _inner_part(
    source: Source, registry: Registry, keys: Keys, choice: PartChoice, mistakes: list[Mistake]
) -> PartChoice:
    """Return the choice of a part within a part's options, with all options; add its mistakes to `mistakes`."""
    written = {"use": choice.use, **choice.part_options}
    models: list[type[BaseModel]] = []

    def model_of(name: str) -> type[BaseModel]:
        models.append(options_model(registry.get(choice.kind, name)))
        return models[-1]

    before = len(mistakes)
    _spec(source, keys, choice.kind, written, mistakes, model_of)
    return choice if len(mistakes) > before else choice.completed(models[-1])


def _spec(
    source: Source,
    keys: Keys,
    kind: str,
    written: dict[str, Any],
    mistakes: list[Mistake],
    model_of: Callable[[str], type[BaseModel]],
) -> dict[str, Any]:
    """Return the specification of what is named with `use`, with all options; add its mistakes to `mistakes`."""
    blank = {"use": "", "options": {}}
    name = written["use"]
    try:
        model = model_of(name)
    except UserError as error:
        mistakes.append(Mistake(source.location((*keys, "use")), str(error)))
        return blank
    except Exception as error:  # a part's constructor may have annotations that cannot be evaluated
        text = f"the options of {kind} '{name}' cannot be read from its constructor: {error}"
        mistakes.append(Mistake(source.location((*keys, "use")), text))
        return blank
    options = _options(written)
    try:
        checked = model.model_validate_json(json.dumps(options))
    except ValidationError as error:

        def locate(inner: Keys, of_name: bool) -> Location:
            return source.location((*keys, *inner), of_name=of_name)

        mistakes += mistakes_of(error, options, model, (f"{kind} '{name}'",), locate)
        return blank
    return {"use": name, "options": {key: getattr(checked, key) for key in type(checked).model_fields}}


def _code(data: dict[str, Any], registry: Registry, parts: Collection[Keys]) -> dict[str, str]:
    """Return the identifiers of the parts' code: the present one of checked parts, the recorded one of others."""
    written = data.get("code")
    code: dict[str, str] = {}
    for keys, kind in PARTS.items():
        location = ".".join(map(str, keys))
        spec = (owner_of(data, keys) or {}).get(str(keys[-1]))
        if keys in parts:
            entry = registry.entries.get((kind, spec["use"])) if isinstance(spec, dict) else None
            known = entry.code if entry is not None else None
        else:
            known = written.get(location) if isinstance(written, dict) else None
        if isinstance(known, str):
            code[location] = known
        for option, value in (spec.get("options") or {} if isinstance(spec, dict) and keys in parts else {}).items():
            if isinstance(value, PartChoice):
                inner = registry.entries.get((value.kind, value.use))
                if inner is not None and inner.code is not None:
                    code[f"{location}.{option}"] = inner.code
        if keys not in parts and isinstance(written, dict):
            code |= {
                key: one for key, one in written.items() if key.startswith(f"{location}.") and isinstance(one, str)
            }
    if is_graft(data):
        location = ".".join(map(str, NETWORK_KEYS))
        known = network_code(data, registry) if NETWORK_PART in parts else (written or {}).get(location)
        if isinstance(known, str):
            code[location] = known
    return code


def _is_part(written: Any) -> TypeGuard[dict[str, Any]]:
    return isinstance(written, dict) and isinstance(written.get("use"), str)


def _options(written: dict[str, Any]) -> dict[str, Any]:
    return {key: option for key, option in written.items() if key != "use"}


def _unknown_names(source: Source, registry: Registry) -> list[Mistake]:
    """List the metrics and baselines that are not registered or cannot be loaded."""
    found = []
    for (section, key), kind in NAMES.items():
        written = source.data.get(section)
        names = written.get(key) if isinstance(written, dict) else None
        for index, name in enumerate(names if isinstance(names, list | tuple) else ()):
            try:
                if isinstance(name, str):
                    registry.get(kind, name)
            except UserError as error:
                found.append(Mistake(source.location((section, key, index)), f"{section}.{key}.{index}: {error}"))
    return found
