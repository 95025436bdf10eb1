"""Checking a recipe: every mistake at once, each with its place and the fix."""

import copy
from collections.abc import Callable
from typing import Any

from pydantic import BaseModel, ValidationError

from pcsr.errors import UserError, did_you_mean
from pcsr.recipe.compose import PARTS
from pcsr.recipe.schema import DEFAULTS, Recipe, options_model
from pcsr.recipe.source import Keys, Mistake, Place, RecipeError, Source
from pcsr.registry import Registry

Locate = Callable[[Keys, bool], Place]


def check(source: Source, registry: Registry) -> Recipe:
    """The recipe that a source describes.

    Raises:
        RecipeError: it has mistakes; all of them.
    """
    data = _with_defaults(source.data)
    mistakes: list[Mistake] = []
    for keys in sorted(PARTS):
        section = data.get(keys[0])
        if isinstance(section, dict) and section.get(keys[1]) is not None:
            section[keys[1]] = _part(source, registry, keys, section[keys[1]], mistakes)
    recipe: Recipe | None = None
    try:
        recipe = Recipe.model_validate(data)
    except ValidationError as error:
        mistakes += _mistakes(error, data, Recipe, (), lambda keys, name: source.place(keys, of_name=name))
    if recipe is not None:
        mistakes += _contradictions(source, recipe)
    if mistakes or recipe is None:
        raise RecipeError(mistakes)
    return recipe


def _with_defaults(data: dict[str, Any]) -> dict[str, Any]:
    filled = copy.deepcopy(data)
    for section, defaults in DEFAULTS.items():
        if section == "model":
            filled.setdefault(section, copy.deepcopy(defaults))
        elif isinstance(filled.setdefault(section, {}), dict):
            filled[section] = {**copy.deepcopy(defaults), **filled[section]}
    return filled


def _part(source: Source, registry: Registry, keys: Keys, value: Any, mistakes: list[Mistake]) -> dict[str, Any]:
    """A part's spec with all its options; what is wrong with it goes into `mistakes`."""
    kind = {"touch_encoder": "encoder"}.get(str(keys[-1]), str(keys[-1]))
    written = {"use": value} if isinstance(value, str) else value
    blank = {"use": "", "options": {}}
    if not isinstance(written, dict) or not isinstance(written.get("use"), str):
        text = f"{keys[-1]}: name the part, as `{keys[-1]}: {(registry.names(kind) or ['name'])[0]}` or with `use:`"
        mistakes.append(Mistake(source.place(keys), text))
        return blank
    name = written["use"]
    place = source.place((*keys, "use") if isinstance(value, dict) else keys)
    try:
        model = options_model(registry.get(kind, name))
    except (UserError, TypeError) as error:
        mistakes.append(Mistake(place, str(error)))
        return blank
    options = {key: option for key, option in written.items() if key != "use"}
    try:
        checked = model.model_validate(options)
    except ValidationError as error:
        locate: Locate = lambda inner, of_name: source.place((*keys, *inner), of_name=of_name)  # noqa: E731
        mistakes += _mistakes(error, options, model, (f"{kind} '{name}'",), locate)
        return blank
    return {"use": name, "options": {key: getattr(checked, key) for key in type(checked).model_fields}}


def _mistakes(
    error: ValidationError, data: Any, model: type[BaseModel], head: tuple[str, ...], locate: Locate
) -> list[Mistake]:
    """Pydantic's errors in our words, one for each place: the branches of a union are one mistake."""
    by_keys: dict[Keys, list[Any]] = {}
    for one in error.errors():
        missing = one["type"] in ("missing", "extra_forbidden")
        keys = one["loc"] if missing else _existing(one["loc"], data)
        by_keys.setdefault(keys, []).append(one)
    return [_mistake(keys, ones, model, head, locate) for keys, ones in by_keys.items()]


def _mistake(keys: Keys, ones: list[Any], model: type[BaseModel], head: tuple[str, ...], locate: Locate) -> Mistake:
    kind = ones[0]["type"]
    path = ".".join(map(str, (*head, *keys)))
    if kind == "extra_forbidden":
        owner = " ".join([*head, *(str(k) for k in keys[:-1])]) or "a recipe"
        remedy = did_you_mean(str(keys[-1]), _fields(model, keys[:-1]))
        return Mistake(locate(keys, True), f"{owner} takes no '{keys[-1]}': {remedy}")
    if kind == "missing":
        return Mistake(locate(keys[:-1], False), f"{path} is missing: add it")
    said = " or ".join(dict.fromkeys(one["msg"][0].lower() + one["msg"][1:] for one in ones))
    return Mistake(locate(keys, False), f"{path}: {said}, got {ones[0]['input']!r}")


def _existing(loc: tuple[int | str, ...], data: Any) -> Keys:
    """The part of pydantic's location that leads through the data; it adds the branches of unions."""
    keys: list[int | str] = []
    for key in loc:
        if isinstance(data, dict) and key in data:
            data = data[key]
        elif isinstance(data, list | tuple) and isinstance(key, int) and key < len(data):
            data = data[key]
        else:
            break
        keys.append(key)
    return tuple(keys)


def _fields(model: type[BaseModel], keys: Keys) -> list[str]:
    for key in keys:
        annotation = model.model_fields[str(key)].annotation
        if not (isinstance(annotation, type) and issubclass(annotation, BaseModel)):
            return []
        model = annotation
    extra = ["extends", "matrix"] if model is Recipe else []
    return [*model.model_fields, *extra]


def _contradictions(source: Source, recipe: Recipe) -> list[Mistake]:
    """Values that are right one by one, but not together."""
    found = []
    low, high = recipe.touch_range
    if low > high:
        text = f"train.touches: the least, {low}, is more than the most, {high}: swap them"
        found.append(Mistake(source.place(("train", "touches")), text))
    return found
