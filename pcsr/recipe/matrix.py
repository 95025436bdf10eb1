"""Matrix of a recipe: keys with lists of values, of which each combination is one run."""

import itertools
import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

from pcsr.recipe.merge import assign, assign_dotted
from pcsr.recipe.old_names import modern_key
from pcsr.recipe.part_keys import is_graft
from pcsr.recipe.schema import NAME
from pcsr.recipe.source import Keys, Location, Mistake, Source
from pcsr.validation_messages import shown

LONGEST_LABEL = 60
"""Greatest number of characters that a value of the matrix adds to the name of its run."""
NOT_IN_LABELS = re.compile(r"(?:[^a-z0-9_-]|(?<![a-z0-9])-|-(?![a-z0-9]))+")
"""What a full stop replaces in the label of a value: hyphens stay between letters and digits."""


def add_axis(source: Source, axis: str, values: Sequence[Any]) -> None:
    """Add an axis to the matrix of a recipe, or replace the axis of this key.

    If the axis is `seed`, it varies the training only: the data keeps its seed.

    Args:
        source: recipe to change.
        axis: dotted key. Of a graft, `model.fusion` means its own fusion.
        values: values of the key.
    """
    axis = modern_key(axis)
    if is_graft(source.data) and axis in ("model.fusion", "model.touch_encoder"):
        axis = axis.replace("model.", "model.graft.")
    data = source.data.get("data", {})
    if axis == "seed" and isinstance(data, dict) and data.get("seed") is None:
        assign(source, ("data", "seed"), source.data.get("seed", 0), Location("--seeds"))
    matrix = source.data.setdefault("matrix", {})
    if isinstance(matrix, dict):  # `expand` reports any other type
        matrix[axis] = list(values)
        source.values.setdefault(("matrix",), source.values[()])
        for number, value in enumerate(values):
            source.values["matrix", axis, number] = Location(f"--{axis.rpartition('.')[2]} {value}")


def varied(rows: Any) -> set[str]:
    """Return the dotted keys of an axis whose values are groups of keys that vary together."""
    return {key for row in rows if _is_group(row) for key in row} if isinstance(rows, list) else set()


def count_runs(source: Source) -> int:
    """Return the number of runs of a matrix."""
    matrix = source.data.get("matrix")
    if not isinstance(matrix, dict):
        return 1
    return math.prod(len(values) for values in matrix.values() if isinstance(values, list))


def expand(source: Source) -> Iterator[Source]:
    """Yield a recipe for each combination of a matrix's values, named after them."""
    matrix = source.data.pop("matrix", None)
    if matrix is None:
        yield source
        return
    mistakes = _matrix_mistakes(source, matrix)
    if mistakes:
        source.mistakes += mistakes
        yield source
        return
    labels = [_labels(axis, values) for axis, values in matrix.items()]
    written, source = source, source.copy()
    for locations in (source.values, source.names):  # those of the matrix are not copied for each run
        for keys in [keys for keys in locations if keys[:1] == ("matrix",)]:
            del locations[keys]
    for row in itertools.product(*(range(len(values)) for values in matrix.values())):
        run = source.copy()
        for (axis, values), index in zip(matrix.items(), row, strict=True):
            _vary(run, written, axis, values[index], index)
        name = source.data.get("name")
        if isinstance(name, str) and re.fullmatch(NAME, name):  # an invalid name is reported as it is written
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


def _matrix_mistakes(source: Source, matrix: Any) -> list[Mistake]:
    text = "a matrix maps dotted keys to lists of values: `model.fusion: [none, concat]`"
    if not isinstance(matrix, dict):
        return [Mistake(source.location(("matrix",)), text)]
    mistakes = []
    for axis, rows in matrix.items():
        if axis in ("extends", "matrix"):
            mistake = f"a matrix cannot vary '{axis}': write it at the top level of the file"
            mistakes.append(Mistake(source.location(("matrix", axis), of_name=True), mistake))
        elif not (isinstance(rows, list) and rows):
            mistakes.append(Mistake(source.location(("matrix", axis)), text))
    return mistakes


def _is_group(value: Any) -> bool:
    """Return whether a value is a group of keys, such as `{model.fusion: none, model.touch_encoder: null}`."""
    return isinstance(value, dict) and bool(value) and all("." in key for key in value)


def _labels(axis: str, values: list[Any]) -> list[str]:
    """Return a label for each value of an axis; the labels are numbered if two would be the same."""
    labels = [_label(axis, value) for value in values]
    if len(set(labels)) == len(labels):
        return labels
    return [f"{label}.{number}" for number, label in enumerate(labels, 1)]


def _label(axis: str, value: Any) -> str:
    """Return the label of an axis and value, such as `fusion.cross-attention`; a group's first value is used."""
    first = next(iter(value.values())) if _is_group(value) else value
    named = first.get("use", "") if isinstance(first, dict) else first
    text = named if isinstance(named, str) else shown(named)
    label = f"{axis.rpartition('.')[2]}.{text[:LONGEST_LABEL]}".lower()
    return NOT_IN_LABELS.sub(".", label)[:LONGEST_LABEL].strip(".-")
