"""From files and options to the data of each run: `extends`, `recipes`, `--set`, `matrix`."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pcsr.errors import UserError
from pcsr.mistakes import shortened, shown, shown_path
from pcsr.recipe.matrix import add_axis, count_runs, expand, varied
from pcsr.recipe.merge import assign, assign_dotted, merge, normalize
from pcsr.recipe.source import DEEPEST, Keys, Location, Mistake, RecipeError, Source, read, scalar

MOST_RUNS = 1_000
"""Runs that one command composes: rows of a matrix, recipes of a study, and both together."""
MOST_PARENTS = 32
"""Files that extend each other in a row."""
LONGEST_PLACE = 200
"""Characters of an option that stand in front of what is wrong with it."""


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
            override_key(source, override)
        for axis, values in (axes or {}).items():
            add_axis(source, axis, values)
        runs += count_runs(source)
        if runs > MOST_RUNS:
            text = f"that makes {shown(runs)} runs or more, and one command takes at most {MOST_RUNS}: split the study"
            raise RecipeError([Mistake(source.location(("matrix",)), text)])
        yield from expand(source)


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
            raise RecipeError([Mistake(study.location(item), text)])
        target = path.parent / changes["use"]
        if not os.path.isfile(target):  # a name that no file can have is no error to this one
            text = f"there is no recipe {shown_path(target)}: it is relative to this file"
            raise RecipeError([Mistake(study.location(item), text)])
        single = _with_parents(target, ())
        if "recipes" in single.data:
            text = f"{target} is a study itself, and a study names recipes: name those of it"
            raise RecipeError([Mistake(study.location(item), text)])
        name = changes.get("name", single.data.get("name"))
        made = merge(single, study)
        for dotted, value in changes.items():
            if dotted != "use":
                assign_dotted(made, dotted, value, study.location((*item, dotted)))
        if isinstance(name, str) and isinstance(study.data.get("name"), str):
            made.data["name"] = f"{study.data['name']}-{name}"
        yield made


def _with_parents(path: Path, children: tuple[Path, ...]) -> Source:
    source = normalize(read(path))
    if "extends" not in source.data:
        return source
    parent = source.data.pop("extends")
    location = source.values[("extends",)]
    if not isinstance(parent, str):
        raise RecipeError([Mistake(location, f"extends names one recipe file, got {shown(parent)}")])
    target = path.parent / parent
    line = (*children, path.resolve())
    if not os.path.isfile(target):  # a name that no file can have is no error to this one
        text = f"there is no recipe {shown_path(target)}: extends is relative to this file"
        raise RecipeError([Mistake(location, text)])
    if target.resolve() in line:
        raise RecipeError([Mistake(location, f"'{parent}' extends this recipe in turn: break the circle")])
    if len(line) > MOST_PARENTS:
        text = f"more than {MOST_PARENTS} recipes extend each other in a row: extend one that stands further up"
        raise RecipeError([Mistake(location, text)])
    return merge(_with_parents(target, line), source)


def override_key(source: Source, override: str, written: str | None = None) -> None:
    """Apply `dotted.key=value`. It wins over a matrix, which no longer varies that key.

    Args:
        source: what to change; mistakes go into it.
        override: what to apply.
        written: what a person wrote for it, if that was something else.
    """
    location = Location(f"--set {shortened(written or override, LONGEST_PLACE)}")
    dotted, equals, text = override.partition("=")
    keys = tuple(dotted.split("."))
    matrix = source.data.get("matrix")
    axes = matrix if isinstance(matrix, dict) else {}
    together = [axis for axis, rows in axes.items() if axis != dotted and dotted in varied(rows)]
    if not equals or not all(keys):
        remedy = "write --set dotted.key=value, for example --set train.epochs=5"
        source.mistakes.append(Mistake(location, remedy))
    elif len(keys) > DEEPEST:
        text = f"it has {len(keys)} keys in each other, and no recipe more than {DEEPEST}"
        source.mistakes.append(Mistake(location, text))
    elif keys[0] == "extends":
        source.mistakes.append(Mistake(location, "extends is read before --set: write it in the file"))
    elif together:
        remedy = f"the matrix varies {dotted} together with others: change matrix.{together[0]} in the file"
        source.mistakes.append(Mistake(location, remedy))
    else:
        axes.pop(dotted, None)
        try:
            assign(source, keys, scalar(text, location), location)
        except RecipeError as error:
            source.mistakes += error.mistakes
