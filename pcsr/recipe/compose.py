"""Composition of the runs that a recipe file describes: `extends`, `recipes`, `--set` and `matrix`."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from pcsr import recipes
from pcsr.errors import UserError
from pcsr.recipe.matrix import add_axis, count_runs, expand, varied
from pcsr.recipe.merge import assign, assign_dotted, merge, normalize
from pcsr.recipe.old_names import modern_key
from pcsr.recipe.source import DEEPEST, Keys, Location, Mistake, RecipeError, Source, read, scalar
from pcsr.validation_messages import shortened, shown, shown_path

MOST_RUNS = 1_000
"""Greatest number of runs of one command, over all rows of a matrix and recipes of a study."""
MOST_PARENTS = 32
"""Greatest length of a chain of files that extend each other."""
LONGEST_OPTION = 200
"""Greatest length, in characters, at which a message quotes an option."""


def compose(
    path: Path, overrides: Sequence[str] = (), axes: Mapping[str, Sequence[Any]] | None = None
) -> Iterator[Source]:
    """Yield the data of each run that a recipe file describes: one, unless it names recipes or has a matrix.

    Args:
        path: recipe file.
        overrides: changes of the form `dotted.key=value`, with the value in YAML.
        axes: dotted keys with the values to vary, as in a matrix.

    Raises:
        RecipeError: a file is not YAML, its `extends` or `recipes` is wrong, or there are more than `MOST_RUNS` runs.
            Other mistakes are added to the sources.
        UserError: a file cannot be read.
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
            text = f"it has {shown(runs)} runs or more, and one command takes at most {MOST_RUNS}: split the study"
            raise RecipeError([Mistake(source.location(("matrix",)), text)])
        yield from expand(source)


def compared(path: Path, study: Source) -> Iterator[Source]:
    """Yield the recipes that a study names, each overridden by the rest of the study; or the recipe itself.

    Args:
        path: file of the study; the recipes that it names are relative to it.
        study: data of the study, or of a single recipe.

    Raises:
        RecipeError: `recipes` is not a list of recipe files.
    """
    if "recipes" not in study.data:
        yield study
        return
    rows = study.data.pop("recipes")
    path = Path(study.values[("recipes",)].origin)  # the key may stand in a parent of the study, in another folder
    if not (isinstance(rows, list) and rows):
        text = "recipes must be a list of recipe files: `recipes: [tapsr.yaml, pu-gan.yaml]`"
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
        target = _named(path, changes["use"], study.location(item), "it is")
        single = _with_parents(target, ())
        if "recipes" in single.data:
            text = f"{target} is a study itself: name its recipes instead"
            raise RecipeError([Mistake(study.location(item), text)])
        name = changes.get("name", single.data.get("name"))
        merged = merge(single, study)
        for dotted, value in changes.items():
            if dotted != "use":
                assign_dotted(merged, dotted, value, study.location((*item, dotted)))
        if isinstance(name, str) and isinstance(study.data.get("name"), str):
            merged.data["name"] = f"{study.data['name']}-{name}"
        yield merged


def _with_parents(path: Path, children: tuple[Path, ...]) -> Source:
    """Read a recipe file and merge it with those that it extends; `children` are the files that extend it."""
    source = normalize(read(path))
    if "extends" not in source.data:
        return source
    parent = source.data.pop("extends")
    location = source.values[("extends",)]
    if not isinstance(parent, str):
        raise RecipeError([Mistake(location, f"extends must be one recipe file, got {shown(parent)}")])
    target = _named(path, parent, location, "extends is")
    chain = (*children, path.resolve())
    if target.resolve() in chain:
        raise RecipeError([Mistake(location, f"'{parent}' extends this recipe in turn: break the circle")])
    if len(chain) > MOST_PARENTS:
        text = f"more than {MOST_PARENTS} recipes extend each other in a chain: shorten it"
        raise RecipeError([Mistake(location, text)])
    return merge(_with_parents(target, chain), source)


def _named(path: Path, use: str, location: Location, subject: str) -> Path:
    """Return the file that a recipe names: relative to the recipe's own file, or one that comes with pcsr.

    Raises:
        RecipeError: there is neither.
    """
    target = path.parent / use
    if os.path.isfile(target):  # unlike `Path.is_file`, it accepts names that no file can have
        return target
    name = use.removeprefix("recipes/").removesuffix(".yaml")
    if name in recipes.names():
        return recipes.found(Path(name))
    text = f"there is no recipe {shown_path(target)}: {subject} relative to this file, or names a recipe of pcsr"
    raise RecipeError([Mistake(location, text)])


def override_key(source: Source, override: str, written: str | None = None) -> None:
    """Apply `dotted.key=value` to a recipe. A matrix no longer varies this key.

    Args:
        source: recipe to change; mistakes are added to it.
        override: the change, with the value in YAML.
        written: the option as the user wrote it, for messages; `override` by default.
    """
    location = Location(f"--set {shortened(written or override, LONGEST_OPTION)}")
    dotted, equals, text = override.partition("=")
    keys = tuple(dotted.split("."))
    matrix = source.data.get("matrix")
    axes = matrix if isinstance(matrix, dict) else {}
    modern = modern_key(dotted)  # as the axes of a matrix are
    together = [axis for axis, rows in axes.items() if axis != modern and modern in varied(rows)]
    if not equals or not all(keys):
        remedy = "write --set dotted.key=value, for example --set train.epochs=5"
        source.mistakes.append(Mistake(location, remedy))
    elif len(keys) > DEEPEST:
        text = f"it nests {len(keys)} keys, and a recipe at most {DEEPEST}: shorten it"
        source.mistakes.append(Mistake(location, text))
    elif keys[0] == "extends":
        source.mistakes.append(Mistake(location, "extends cannot be set by an option: write it in the file"))
    elif together:
        remedy = f"the matrix varies {dotted} together with others: change matrix.{together[0]} in the file"
        source.mistakes.append(Mistake(location, remedy))
    else:
        axes.pop(modern, None)
        try:
            assign(source, keys, scalar(text, location), location)
        except RecipeError as error:
            source.mistakes += error.mistakes
