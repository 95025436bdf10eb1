"""Checking a recipe: every mistake at once, each with its place and the fix."""

import copy
import json
from collections.abc import Callable, Collection
from typing import Any

from pydantic import BaseModel, ValidationError

from pcsr.errors import UserError, did_you_mean
from pcsr.mistakes import explained, shown
from pcsr.plugins.registry import Registry
from pcsr.recipe.merge import merge
from pcsr.recipe.old_names import modernize
from pcsr.recipe.part_keys import MODEL, PARTS
from pcsr.recipe.schema import DEFAULTS, MOST_RAYS, MOST_TRUTH, Evaluate, Recipe, options_model
from pcsr.recipe.source import Keys, Mistake, Place, RecipeError, Source

Locate = Callable[[Keys, bool], Place]
"""Where a value stands, or the key of one."""


def check(source: Source, registry: Registry, parts: Collection[Keys] = PARTS.keys()) -> Recipe:
    """The recipe that a source describes.

    Args:
        source: what is written.
        registry: gives the parts that are checked.
        parts: the places of these, of `PARTS`. Elsewhere a part is plain data: it need not be installed, and its
            options stay as they are written.

    Raises:
        RecipeError: it has mistakes; all of them.
    """
    source = source.copy()
    modernize(source)
    data = _with_defaults(source)
    mistakes: list[Mistake] = []
    for keys, kind in PARTS.items():
        section = data.get(str(keys[0]))
        optional = keys == ("model", "touch_encoder")
        if isinstance(section, dict) and keys[1] in section and not (optional and section[keys[1]] is None):
            written = section[keys[1]]
            if keys in parts or not _is_part(written):
                section[keys[1]] = _part(source, registry, keys, kind, written, mistakes)
            else:
                section[keys[1]] = {"use": written["use"], "options": _options(written)}
    data["code"] = _code(data, registry, parts)
    recipe: Recipe | None = None
    try:
        recipe = Recipe.model_validate(data)
    except ValidationError as error:
        mistakes += _mistakes(error, data, Recipe, (), lambda keys, name: source.place(keys, of_name=name))
    # What could not be read is no value: that it has the wrong type too is no second mistake.
    unread = {mistake.place for mistake in source.mistakes}
    mistakes = [*source.mistakes, *(mistake for mistake in mistakes if mistake.place not in unread)]
    if recipe is not None and not mistakes:
        mistakes = _contradictions(source, recipe, registry)
    if mistakes or recipe is None:
        raise RecipeError(mistakes)
    return recipe


def check_card(written: dict[str, Any], registry: Registry, origin: str) -> Recipe:
    """The recipe in the card of weights, as far as inference needs it.

    The parts of the network are checked and must be here. Those of the data and the training are plain data; a section
    `evaluate` that this version cannot read is left out.

    Args:
        written: what `Recipe.resolved` gave when the weights were made.
        registry: gives the parts.
        origin: names it in messages.

    Raises:
        RecipeError: it has mistakes, or names parts or options of the network that are not here.
    """
    source = Source(copy.deepcopy(written), {(): Place(origin)})
    modernize(source)
    try:
        Evaluate.model_validate(source.data.get("evaluate", {}))
    except ValidationError:
        del source.data["evaluate"]
    return check(source, registry, MODEL)


def _with_defaults(source: Source) -> dict[str, Any]:
    defaults = {section: parts for section, parts in DEFAULTS.items() if section not in source.data}
    defaults |= {section: DEFAULTS[section] for section in ("data", "train")}
    return merge(Source(defaults, {(): source.values[()]}), source).data


def _part(
    source: Source, registry: Registry, keys: Keys, kind: str, written: Any, mistakes: list[Mistake]
) -> dict[str, Any]:
    """A part's spec with all its options; what is wrong with it goes into `mistakes`."""
    blank = {"use": "", "options": {}}
    if not _is_part(written):
        example = next(iter(registry.names(kind)), "name")
        text = f"{'.'.join(map(str, keys))}: name the part, as `{keys[-1]}: {example}` or with `use:`"
        mistakes.append(Mistake(source.place(keys), text))
        return blank
    name = written["use"]
    try:
        model = options_model(registry.get(kind, name))
    except UserError as error:
        mistakes.append(Mistake(source.place((*keys, "use")), str(error)))
        return blank
    except Exception as error:  # a constructor whose types can't be read is its author's mistake, not ours
        text = f"the options of {kind} '{name}' cannot be read off its constructor: {error}"
        mistakes.append(Mistake(source.place((*keys, "use")), text))
        return blank
    options = _options(written)
    try:
        checked = model.model_validate_json(json.dumps(options))
    except ValidationError as error:

        def locate(inner: Keys, of_name: bool) -> Place:
            return source.place((*keys, *inner), of_name=of_name)

        mistakes += _mistakes(error, options, model, (f"{kind} '{name}'",), locate)
        return blank
    return {"use": name, "options": {key: getattr(checked, key) for key in type(checked).model_fields}}


def _code(data: dict[str, Any], registry: Registry, parts: Collection[Keys]) -> dict[str, str]:
    """The code of the parts: of those that are checked as it is here, of others what is written."""
    written = data.get("code")
    code: dict[str, str] = {}
    for keys, kind in PARTS.items():
        place = ".".join(map(str, keys))
        section = data.get(str(keys[0]))
        spec = section.get(keys[1]) if isinstance(section, dict) else None
        if keys in parts:
            entry = registry.entries.get((kind, spec["use"])) if isinstance(spec, dict) else None
            known = entry.code if entry is not None else None
        else:
            known = written.get(place) if isinstance(written, dict) else None
        if isinstance(known, str):
            code[place] = known
    return code


def _is_part(written: Any) -> bool:
    return isinstance(written, dict) and isinstance(written.get("use"), str)


def _options(written: dict[str, Any]) -> dict[str, Any]:
    return {key: option for key, option in written.items() if key != "use"}


def _mistakes(
    error: ValidationError, data: Any, model: type[BaseModel], head: tuple[str, ...], locate: Locate
) -> list[Mistake]:
    """Pydantic's errors in our words, one for each place: the branches of a union are one mistake."""
    by_keys: dict[Keys, list[Any]] = {}
    for one in error.errors():
        missing = one["type"] in ("missing", "extra_forbidden")
        keys = one["loc"] if missing else _existing(one["loc"], data)
        by_keys.setdefault(keys, []).append(one)
    # A branch that was entered says more than the one beside it that wanted something else altogether.
    entered = {keys[:depth] for keys in by_keys for depth in range(len(keys))}
    return [_mistake(keys, ones, model, head, locate) for keys, ones in by_keys.items() if keys not in entered]


def _mistake(keys: Keys, ones: list[Any], model: type[BaseModel], head: tuple[str, ...], locate: Locate) -> Mistake:
    kind = ones[0]["type"]
    path = ".".join((*head, *map(_key, keys)))
    if kind == "extra_forbidden":
        owner = " ".join([*head, *map(_key, keys[:-1])]) or "a recipe"
        if not head and str(keys[-1]) in ("extends", "matrix", "recipes"):
            return Mistake(locate(keys, True), f"'{keys[-1]}' is read before this: write it at the top of the file")
        remedy = did_you_mean(str(keys[-1]), _fields(model, keys[:-1]))
        return Mistake(locate(keys, True), f"{owner} takes no '{_key(keys[-1])}': {remedy}")
    if kind == "missing":
        return Mistake(locate(keys[:-1], False), f"{path} is missing: add it")
    if kind == "model_type":
        got = shown(ones[0]["input"])
        return Mistake(locate(keys, False), f"{path} is a section: write its keys under it, got {got}")
    return Mistake(locate(keys, False), f"{path}: {explained(ones)}")


def _key(key: int | str) -> str:
    """A key in a message, shortened where it is long."""
    return shown(key)[1:-1] if isinstance(key, str) else str(key)


def _existing(loc: tuple[int | str, ...], data: Any) -> Keys:
    """Pydantic's location without the branches of unions, which are no keys of the data."""
    keys: list[int | str] = []
    for key in loc:
        try:
            data = data[key]
        except (LookupError, TypeError):
            continue
        keys.append(key)
    return tuple(keys)


def _fields(model: type[BaseModel], keys: Keys) -> list[str]:
    for key in keys:
        annotation = model.model_fields[str(key)].annotation
        if not (isinstance(annotation, type) and issubclass(annotation, BaseModel)):
            return []
        model = annotation
    extra = ["extends", "matrix", "recipes"] if model is Recipe else []
    return [*model.model_fields, *extra]


def _contradictions(source: Source, recipe: Recipe, registry: Registry) -> list[Mistake]:
    """Values that are right one by one, but not together."""
    found = []
    low, high = recipe.touch_range
    if low > high:
        text = f"train.touches: the least, {low}, is more than the most, {high}: swap them"
        found.append(Mistake(source.place(("train", "touches")), text))
    for section, key in (("train", "augment"), ("evaluate", "metrics"), ("evaluate", "baselines")):
        names = getattr(getattr(recipe, section), key)
        for index, name in enumerate(names):
            if name in names[:index]:
                text = f"{section}.{key}: '{name}' is there already: remove one of the two"
                found.append(Mistake(source.place((section, key, index)), text))
    found += _too_large(source, recipe)
    if recipe.patches:
        found += _of_patches(source, recipe)
    fusion = recipe.model.fusion.use
    if recipe.model.touch_encoder is not None and not registry.get("fusion", fusion).uses_touch_features:
        text = f"fusion '{fusion}' uses no touch features, so a touch_encoder would have no effect: remove it"
        found.append(Mistake(source.place(("model", "touch_encoder")), text))
    return found


def _too_large(source: Source, recipe: Recipe) -> list[Mistake]:
    """Sizes of the data that have a limit together."""
    data, view, found = recipe.data, recipe.data.view, []
    truth, rays = data.points * data.rate, view.cameras * view.pixels**2
    if truth > MOST_TRUTH:
        text = f"data.points × data.rate are {truth} points of an object, more than {MOST_TRUTH}: lower one of them"
        found.append(Mistake(source.place(("data", "points")), text))
    if rays > MOST_RAYS:
        text = (
            f"data.view: {view.cameras} cameras of {view.pixels} × {view.pixels} pixels are {rays} lines of sight, "
            f"more than {MOST_RAYS}: lower cameras or pixels"
        )
        found.append(Mistake(source.place(("data", "view")), text))
    return found


def _of_patches(source: Source, recipe: Recipe) -> list[Mistake]:
    patches, data = recipe.patches, recipe.data
    if patches is None:
        return []
    found = []
    reached = patches.rate
    while reached < data.rate:
        reached *= patches.rate
    if reached != data.rate:
        text = (
            f"patches.rate is {patches.rate}, and no power of it is data.rate, {data.rate}: "
            f"applied again and again, the network never makes so many points"
        )
        found.append(Mistake(source.place(("patches", "rate")), text))
    if patches.points * patches.rate > data.points * data.rate:
        text = (
            f"patches.points: a patch of {patches.points} points has {patches.points * patches.rate} of the truth's, "
            f"which are only {data.points * data.rate}: make it smaller"
        )
        found.append(Mistake(source.place(("patches", "points")), text))
    return found
