"""From files and options to the data of each run: `extends`, `recipes`, `--set`, `matrix`."""

import copy
import itertools
import math
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pcsr.errors import UserError
from pcsr.mistakes import shown, shown_path
from pcsr.recipe.schema import DEFAULTS, NAME
from pcsr.recipe.source import DEEPEST, Keys, Mistake, Place, RecipeError, Source, read, scalar

MOST_RUNS = 1_000
"""Runs that one command composes: rows of a matrix, recipes of a study, and both together."""
MOST_PARENTS = 32
"""Files that extend each other in a row."""
LONGEST_LABEL = 60
"""Characters that a value of a matrix adds to the name of its run."""
PARTS: dict[Keys, str] = {
    ("data", "shapes"): "shapes",
    ("data", "touch"): "touch",
    ("model", "encoder"): "encoder",
    ("model", "touch_encoder"): "encoder",
    ("model", "fusion"): "fusion",
    ("model", "backbone"): "backbone",
    ("model", "upsampler"): "upsampler",
    ("train", "objective"): "objective",
}
"""Where a part is named, and of which kind; a bare name is short for `{use: name}` there."""
DATA, MODEL = (frozenset(keys for keys in PARTS if keys[0] == section) for section in ("data", "model"))
"""The parts that building data needs, and those of the network, which are all that inference needs."""


def compose(
    path: Path, overrides: Sequence[str] = (), axes: Mapping[str, Sequence[Any]] | None = None
) -> Iterator[Source]:
    """Every run that a recipe file describes; one, unless it compares recipes or has a matrix.

    Raises:
        RecipeError: a file that is not YAML, or extends or compares what it can't, or describes more than `MOST_RUNS`
            runs. Other mistakes go into the sources.
        UserError: a file that can't be read.
    """
    if len(overrides) > MOST_RUNS:
        raise UserError(f"--set is given {len(overrides)} times, and at most {MOST_RUNS} are read: use a recipe file")
    runs = 0
    for source in compared(path, _with_parents(path, ())):
        for override in overrides:
            lay_over(source, override)
        for axis, values in (axes or {}).items():
            _add_axis(source, axis, values)
        runs += _count(source)
        if runs > MOST_RUNS:
            text = f"that makes {shown(runs)} runs or more, and one command takes at most {MOST_RUNS}: split the study"
            raise RecipeError([Mistake(source.place(("matrix",)), text)])
        yield from _expand(source)


def compared(path: Path, study: Source) -> Iterator[Source]:
    """The recipes that a study names, each with the rest of the study laid over it; or the one recipe that it is.

    Args:
        path: the study's file, to which the files that it names are relative.
        study: what it says.
    """
    if "recipes" not in study.data:
        yield study
        return
    rows = study.data.pop("recipes")
    path = Path(study.values[("recipes",)].origin)  # of a study that extends another, the file that says so
    if not (isinstance(rows, list) and rows):
        text = "recipes names recipe files in a list: `recipes: [tapsr.yaml, pu-gan.yaml]`"
        raise RecipeError([Mistake(study.values[("recipes",)], text)])
    if len(rows) > MOST_RUNS:
        text = f"recipes names {len(rows)} recipes, and one command takes at most {MOST_RUNS}: split the study"
        raise RecipeError([Mistake(study.values[("recipes",)], text)])
    for number, row in enumerate(rows):
        item: Keys = ("recipes", number)
        changes = row if isinstance(row, dict) else {"use": row}
        if not isinstance(changes.get("use"), str):
            text = "a recipe to compare is a file, or `{use: file, dotted.key: value}`"
            raise RecipeError([Mistake(study.place(item), text)])
        target = path.parent / changes["use"]
        if not os.path.isfile(target):  # a name that no file can have is no error to this one
            text = f"there is no recipe {shown_path(target)}: it is relative to this file"
            raise RecipeError([Mistake(study.place(item), text)])
        single = _with_parents(target, ())
        if "recipes" in single.data:
            text = f"{target} is a study itself, and a study names recipes: name those of it"
            raise RecipeError([Mistake(study.place(item), text)])
        name = changes.get("name", single.data.get("name"))
        made = merge(single, study)
        for dotted, value in changes.items():
            if dotted != "use":
                _assign_dotted(made, dotted, value, study.place((*item, dotted)))
        if isinstance(name, str) and isinstance(study.data.get("name"), str):
            made.data["name"] = f"{study.data['name']}-{name}"
        yield made


def _with_parents(path: Path, children: tuple[Path, ...]) -> Source:
    source = spell_out(read(path))
    if "extends" not in source.data:
        return source
    parent = source.data.pop("extends")
    place = source.values[("extends",)]
    if not isinstance(parent, str):
        raise RecipeError([Mistake(place, f"extends names one recipe file, got {shown(parent)}")])
    target = path.parent / parent
    line = (*children, path.resolve())
    if not os.path.isfile(target):  # a name that no file can have is no error to this one
        text = f"there is no recipe {shown_path(target)}: extends is relative to this file"
        raise RecipeError([Mistake(place, text)])
    if target.resolve() in line:
        raise RecipeError([Mistake(place, f"'{parent}' extends this recipe in turn: break the circle")])
    if len(line) > MOST_PARENTS:
        text = f"more than {MOST_PARENTS} recipes extend each other in a row: extend one that stands further up"
        raise RecipeError([Mistake(place, text)])
    return merge(_with_parents(target, line), source)


def spell_out(source: Source) -> Source:
    """Write the bare name of a part as `{use: name}`, so that options can be laid over it."""
    for keys in PARTS:
        section = source.data.get(str(keys[0]))
        if isinstance(section, dict) and isinstance(section.get(keys[1]), str):
            section[keys[1]] = {"use": section[keys[1]]}
            source.values[(*keys, "use")] = source.place(keys)
    return source


def merge(under: Source, over: Source) -> Source:
    """Lay one recipe over another: mappings key by key, everything else replaced whole.

    The options of a part stay if the same part is named again, and go with it if another is.
    """
    merged = under.copy()
    kept, replaced = _merge_into((), merged.data, over.data)
    for mine, theirs in ((merged.values, over.values), (merged.names, over.names)):
        for known in [keys for keys in mine if _inside(keys, replaced)]:
            del mine[known]
        mine |= {keys: place for keys, place in theirs.items() if keys in kept or _inside(keys, replaced)}
    merged.values[()] = over.values[()]
    merged.mistakes += over.mistakes
    return merged


def _merge_into(keys: Keys, below: dict[str, Any], above: dict[str, Any]) -> tuple[set[Keys], set[Keys]]:
    """Lay `above` over `below`: which values were laid over key by key, and which were replaced whole."""
    kept: set[Keys] = set()
    replaced: set[Keys] = set()
    for key, value in above.items():
        here = (*keys, key)
        old = below.get(key)
        if isinstance(old, dict) and isinstance(value, dict) and not _other_part(here, old, value):
            kept.add(here)
            for all_of, inner in zip((kept, replaced), _merge_into(here, old, value), strict=True):
                all_of |= inner
        else:
            replaced.add(here)
            below[key] = copy.deepcopy(value)
    return kept, replaced


def _inside(keys: Keys, replaced: set[Keys]) -> bool:
    """Whether a value, or one around it, is among those that were replaced."""
    return any(keys[:depth] in replaced for depth in range(1, len(keys) + 1))


def _other_part(keys: Keys, old: dict[str, Any], new: dict[str, Any]) -> bool:
    """The options of one part mean nothing to another."""
    return keys in PARTS and "use" in new and new["use"] != old.get("use")


def lay_over(source: Source, override: str, written: str | None = None) -> None:
    """Apply `dotted.key=value`. It wins over a matrix, which no longer varies that key.

    Args:
        source: what to change; mistakes go into it.
        override: what to apply.
        written: what a person wrote for it, if that was something else.
    """
    place = Place(f"--set {_short(written or override)}")
    dotted, equals, text = override.partition("=")
    keys = tuple(dotted.split("."))
    matrix = source.data.get("matrix")
    axes = matrix if isinstance(matrix, dict) else {}
    together = [axis for axis, rows in axes.items() if axis != dotted and dotted in _varied(rows)]
    if not equals or not all(keys):
        remedy = "write --set dotted.key=value, for example --set train.epochs=5"
        source.mistakes.append(Mistake(place, remedy))
    elif len(keys) > DEEPEST:
        text = f"it has {len(keys)} keys in each other, and no recipe more than {DEEPEST}"
        source.mistakes.append(Mistake(place, text))
    elif keys[0] == "extends":
        source.mistakes.append(Mistake(place, "extends is read before --set: write it in the file"))
    elif together:
        remedy = f"the matrix varies {dotted} together with others: change matrix.{together[0]} in the file"
        source.mistakes.append(Mistake(place, remedy))
    else:
        axes.pop(dotted, None)
        try:
            assign(source, keys, scalar(text, place), place)
        except RecipeError as error:
            source.mistakes += error.mistakes


def _add_axis(source: Source, axis: str, values: Sequence[Any]) -> None:
    """Vary a value as a line of the matrix would; where the matrix does so already, instead of it.

    A seed that is varied like that is the training's: the data keeps the one that it had.
    """
    data = source.data.get("data", {})
    if axis == "seed" and isinstance(data, dict) and data.get("seed") is None:
        assign(source, ("data", "seed"), source.data.get("seed", 0), Place("--seeds"))
    matrix = source.data.setdefault("matrix", {})
    if isinstance(matrix, dict):  # anything else is a mistake that is told later
        matrix[axis] = list(values)
        source.values.setdefault(("matrix",), source.values[()])
        for number, value in enumerate(values):
            source.values["matrix", axis, number] = Place(f"--{axis.rpartition('.')[2]} {value}")


def _short(override: str) -> str:
    return shown(override)[1:-1] if len(override) > 200 else override


def _varied(rows: Any) -> set[str]:
    return {key for row in rows if _is_group(row) for key in row} if isinstance(rows, list) else set()


def assign(source: Source, keys: Keys, value: Any, place: Place, name: Place | None = None) -> None:
    """Put one value into the data, as if a file with nothing else were laid over it."""
    if keys[0] == "model" and len(keys) > 1:  # a change to the model that a recipe without one gets
        source.data.setdefault("model", copy.deepcopy(DEFAULTS["model"]))
    data: Any = value
    over = Source({}, {(): source.values[()], keys: place}, {keys: name or place})
    for depth in range(len(keys), 0, -1):
        data = {keys[depth - 1]: data}
        if keys[:depth] not in source.values:
            over.values[keys[:depth]] = place
            over.names[keys[:depth]] = name or place
    over.data = data
    merged = merge(source, spell_out(over))
    source.data, source.values, source.names = merged.data, merged.values, merged.names


def _assign_dotted(source: Source, dotted: str, value: Any, place: Place, name: Place | None = None) -> None:
    """As `assign`, for a key that a person wrote with dots; one of too many is a mistake."""
    keys = tuple(dotted.split("."))
    if len(keys) > DEEPEST:
        text = f"{shown(dotted)} has {len(keys)} keys in each other, and no recipe more than {DEEPEST}"
        source.mistakes.append(Mistake(name or place, text))
    else:
        assign(source, keys, value, place, name)


def _count(source: Source) -> int:
    """How many runs the matrix of a source makes."""
    matrix = source.data.get("matrix")
    if not isinstance(matrix, dict):
        return 1
    return math.prod(len(values) for values in matrix.values() if isinstance(values, list))


def _expand(source: Source) -> Iterator[Source]:
    """A matrix to its product: each row one recipe, named after its values."""
    matrix = source.data.pop("matrix", None)
    if matrix is None:
        yield source
        return
    wrong = _not_a_matrix(source, matrix)
    if wrong:
        source.mistakes += wrong
        yield source
        return
    labels = [_labels(axis, values) for axis, values in matrix.items()]
    written, source = source, source.copy()
    for places in (source.values, source.names):  # those of the matrix would be copied for each run
        for keys in [keys for keys in places if keys[:1] == ("matrix",)]:
            del places[keys]
    for row in itertools.product(*(range(len(values)) for values in matrix.values())):
        run = source.copy()
        for (axis, values), index in zip(matrix.items(), row, strict=True):
            _vary(run, written, axis, values[index], index)
        name = source.data.get("name")
        if isinstance(name, str) and re.fullmatch(NAME, name):  # a bad one is reported as it is written
            run.data["name"] = "-".join([name, *(of[index] for of, index in zip(labels, row, strict=True))])
        yield run


def _vary(run: Source, written: Source, axis: str, value: Any, index: int) -> None:
    item: Keys = ("matrix", axis, index)
    if not _is_group(value):
        _assign_dotted(run, axis, value, written.place(item), written.names.get(item[:2]))
        return
    for dotted, one in value.items():
        inner = (*item, dotted)
        _assign_dotted(run, dotted, one, written.place(inner), written.names.get(inner))


def _not_a_matrix(source: Source, matrix: Any) -> list[Mistake]:
    text = "a matrix maps dotted keys to lists of values: `model.fusion: [none, concat]`"
    if not isinstance(matrix, dict):
        return [Mistake(source.place(("matrix",)), text)]
    wrong = []
    for axis, rows in matrix.items():
        if axis in ("extends", "matrix"):
            mistake = f"a matrix varies values, not '{axis}': write it beside the matrix"
            wrong.append(Mistake(source.place(("matrix", axis), of_name=True), mistake))
        elif not (isinstance(rows, list) and rows):
            wrong.append(Mistake(source.place(("matrix", axis)), text))
    return wrong


def _is_group(value: Any) -> bool:
    """Keys that vary together, under a free name: `{model.fusion: none, model.touch_encoder: null}`."""
    return isinstance(value, dict) and bool(value) and all("." in key for key in value)


def _labels(axis: str, values: list[Any]) -> list[str]:
    """A label for each value of an axis; numbered where two would be the same."""
    labels = [_label(axis, value) for value in values]
    if len(set(labels)) == len(labels):
        return labels
    return [f"{label}.{number}" for number, label in enumerate(labels, 1)]


def _label(axis: str, value: Any) -> str:
    """`touches.3`, `fusion.none`: the axis and its value; of a group, the value that comes first."""
    first = next(iter(value.values())) if _is_group(value) else value
    named = first.get("use", "") if isinstance(first, dict) else first
    text = named if isinstance(named, str) else shown(named)
    label = f"{axis.rpartition('.')[2]}.{text[:LONGEST_LABEL]}".lower()
    return re.sub(r"[^a-z0-9]+", ".", label).strip(".")[:LONGEST_LABEL]
