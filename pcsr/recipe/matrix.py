"""The matrix of a recipe: values that vary, and a run for each of their combinations."""

import itertools
import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

from pcsr.mistakes import shown
from pcsr.recipe.merge import assign, assign_dotted
from pcsr.recipe.old_names import modern_key
from pcsr.recipe.schema import NAME
from pcsr.recipe.source import Keys, Location, Mistake, Source

LONGEST_LABEL = 60
"""Characters that a value of a matrix adds to the name of its run."""


def add_axis(source: Source, axis: str, values: Sequence[Any]) -> None:
    """Vary a value as a line of the matrix would; where the matrix does so already, instead of it.

    A seed that is varied like that is the training's: the data keeps the one that it had.
    """
    axis = modern_key(axis)
    data = source.data.get("data", {})
    if axis == "seed" and isinstance(data, dict) and data.get("seed") is None:
        assign(source, ("data", "seed"), source.data.get("seed", 0), Location("--seeds"))
    matrix = source.data.setdefault("matrix", {})
    if isinstance(matrix, dict):  # anything else is a mistake that is reported later
        matrix[axis] = list(values)
        source.values.setdefault(("matrix",), source.values[()])
        for number, value in enumerate(values):
            source.values["matrix", axis, number] = Location(f"--{axis.rpartition('.')[2]} {value}")


def varied(rows: Any) -> set[str]:
    """The dotted keys that an axis varies together, in groups."""
    return {key for row in rows if _is_group(row) for key in row} if isinstance(rows, list) else set()


def count_runs(source: Source) -> int:
    """How many runs the matrix of a source makes."""
    matrix = source.data.get("matrix")
    if not isinstance(matrix, dict):
        return 1
    return math.prod(len(values) for values in matrix.values() if isinstance(values, list))


def expand(source: Source) -> Iterator[Source]:
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
    for locations in (source.values, source.names):  # those of the matrix would be copied for each run
        for keys in [keys for keys in locations if keys[:1] == ("matrix",)]:
            del locations[keys]
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
        assign_dotted(run, axis, value, written.location(item), written.names.get(item[:2]))
        return
    for dotted, one in value.items():
        inner = (*item, dotted)
        assign_dotted(run, dotted, one, written.location(inner), written.names.get(inner))


def _not_a_matrix(source: Source, matrix: Any) -> list[Mistake]:
    text = "a matrix maps dotted keys to lists of values: `model.fusion: [none, concat]`"
    if not isinstance(matrix, dict):
        return [Mistake(source.location(("matrix",)), text)]
    wrong = []
    for axis, rows in matrix.items():
        if axis in ("extends", "matrix"):
            mistake = f"a matrix varies values, not '{axis}': write it beside the matrix"
            wrong.append(Mistake(source.location(("matrix", axis), of_name=True), mistake))
        elif not (isinstance(rows, list) and rows):
            wrong.append(Mistake(source.location(("matrix", axis)), text))
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
