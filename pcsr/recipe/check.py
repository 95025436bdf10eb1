"""Validation of recipes, which reports all mistakes at once, each with its location in the file and a remedy."""

import copy
import json
from collections.abc import Callable, Collection
from typing import Any, TypeGuard, get_args

from pydantic import BaseModel, ValidationError

from pcsr.errors import UserError, did_you_mean
from pcsr.plugins.part_choice import PartChoice
from pcsr.plugins.registry import Registry
from pcsr.recipe.contradictions import contradictions
from pcsr.recipe.graft import NETWORK_PART, network_code, network_mistakes
from pcsr.recipe.merge import merge
from pcsr.recipe.old_names import KEYS, modernize
from pcsr.recipe.optimizers import optimizer_options
from pcsr.recipe.part_keys import MODEL, NAMES, NETWORK_KEYS, PART_LISTS, PARTS, is_graft, owner_of
from pcsr.recipe.schema import (
    DEFAULTS,
    GRAFT_DEFAULTS,
    GRAFT_TAG,
    PARTS_TAG,
    Evaluate,
    Model,
    Recipe,
    options_model,
)
from pcsr.recipe.source import Keys, Location, Mistake, RecipeError, Source
from pcsr.validation_messages import explained, shown

Locate = Callable[[Keys, bool], Location]
"""Function from the keys of a value to its location in the file or, if the flag is true, to that of its last key."""

TAGS = (PARTS_TAG, GRAFT_TAG)
"""Items of the locations of pydantic's errors that are no keys."""


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
        mistakes += _mistakes(error, data, Recipe, (), lambda keys, name: source.location(keys, of_name=name))
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

        mistakes += _mistakes(error, options, model, (f"{kind} '{name}'",), locate)
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


def _mistakes(
    error: ValidationError, data: Any, model: type[BaseModel], head: tuple[str, ...], locate: Locate
) -> list[Mistake]:
    """Convert pydantic's errors to mistakes, one for each value: errors of a union's branches are merged."""
    by_keys: dict[Keys, list[Any]] = {}
    for one in error.errors():
        missing = one["type"] in ("missing", "extra_forbidden")
        keys = tuple(key for key in one["loc"] if key not in TAGS) if missing else _existing(one["loc"], data)
        by_keys.setdefault(keys, []).append(one)
    # An error within a value says more than one of the whole value, which is of another branch of the union.
    outer = {keys[:depth] for keys in by_keys for depth in range(len(keys))}
    return [_mistake(keys, errors, model, head, locate) for keys, errors in by_keys.items() if keys not in outer]


def _mistake(keys: Keys, errors: list[Any], model: type[BaseModel], head: tuple[str, ...], locate: Locate) -> Mistake:
    kind = errors[0]["type"]
    path = ".".join((*head, *map(_key, keys)))
    if kind == "extra_forbidden":
        owner = " ".join([*head, *map(_key, keys[:-1])]) or "a recipe"
        if not head and str(keys[-1]) in ("extends", "matrix", "recipes"):
            return Mistake(locate(keys, True), f"'{keys[-1]}' is a key of the file: write it at the top level")
        if not head and keys in KEYS:
            new = f"{keys[0]}.{KEYS[keys]}"
            return Mistake(locate(keys, True), f"{path} is the old name of {new}, which is given too: remove it")
        if not head and keys[:-1] == ("model",) and keys[-1] in Model.model_fields:
            return Mistake(locate(keys, True), f"a model has either graft or {keys[-1]}: remove one of the two")
        remedy = did_you_mean(str(keys[-1]), _fields(model, keys[:-1]))
        return Mistake(locate(keys, True), f"{owner} takes no '{_key(keys[-1])}': {remedy}")
    if kind == "missing":
        return Mistake(locate(keys[:-1], False), f"{path} is missing: add it")
    if kind == "model_type":
        got = shown(errors[0]["input"])
        return Mistake(locate(keys, False), f"{path} is a section: write its keys under it, got {got}")
    return Mistake(locate(keys, False), f"{path}: {explained(errors)}")


def _key(key: int | str) -> str:
    """Return a key for a message, shortened if it is long."""
    return shown(key)[1:-1] if isinstance(key, str) else str(key)


def _existing(loc: tuple[int | str, ...], data: Any) -> Keys:
    """Return pydantic's location of an error without the names of union branches, which are not keys of the data."""
    keys: list[int | str] = []
    for key in loc:
        try:
            data = data[key]
        except (LookupError, TypeError):
            continue
        keys.append(key)
    return tuple(keys)


def _fields(model: type[BaseModel], keys: Keys) -> list[str]:
    models: list[type[BaseModel]] = [model]
    for key in keys:
        annotations = [one.model_fields[str(key)].annotation for one in models if str(key) in one.model_fields]
        # Of `Section | None`, the section; of a model, both of its kinds.
        kinds = [getattr(kind, "__origin__", kind) for one in annotations for kind in get_args(one) or (one,)]
        models = [kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel)]
    extra = ["extends", "matrix", "recipes"] if models == [Recipe] else []
    return [*(field for one in models for field in one.model_fields), *extra]


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
