"""Layout, width and number of a layer's features, from the shapes of its outputs."""

from collections.abc import Sequence
from typing import Any

from pcsr.errors import UserError
from pcsr.grafting.observation import Observation, Shape
from pcsr.recipe.graft_section import Layout

MOST_FEATURES = 64
"""Largest number of features for each input point."""
HINTS = 6
"""Largest number of layers that a message names."""
NARROW = 4
"""Layers of fewer channels are not named: they are mostly coordinates, distances or weights."""


def find_features(
    at: str, rows: int, counts: Sequence[int], shapes: Sequence[Shape], layout: Layout | None
) -> tuple[Layout, int, int]:
    """Return layout, width and number for each point of a layer's features.

    Args:
        at: name of the layer.
        rows: number of clouds in a batch.
        counts: number of points in each pass, one or two.
        shapes: shape of the layer's output in each pass.
        layout: the layout, if it is stated.

    Raises:
        UserError: there is not the same number of features for each point, or the shapes are ambiguous.
    """
    passes = [f"{shape} for {count} points" for shape, count in zip(shapes, counts, strict=True)]
    shown = f"layer '{at}' gives {' and '.join(passes)}"
    first = shapes[0]
    as_stated = "(b n c), (b c n) or (b c n 1)" if layout is None else f"'{layout}'"
    other = f"{shown}: not one feature for each point, or k of them, as {as_stated}: graft elsewhere"
    known: dict[tuple[int, int], Layout] = {(3, 1): "bnc", (3, 2): "bcn", (4, 2): "bcn1"}
    axes = [axis for axis in (1, 2) if _multiple(axis, counts, shapes)]
    if layout is not None:
        axes = [axis for axis in axes if known.get((len(first), axis)) == layout]
    elif len(counts) > 1:
        moved = [axis for axis in range(1, len(first)) if len({shape[axis : axis + 1] for shape in shapes}) > 1]
        if len(moved) > 1 and axes:
            raise UserError(f"{shown}: its width is ambiguous: state it with layout='bnc', 'bcn' or 'bcn1'")
        if len(moved) == 1 and moved != axes:
            raise UserError(f"{shown}: another number of points than the input, as after a sampling: graft ahead of it")
        axes = [axis for axis in axes if axis in moved]
    elif len(exact := [axis for axis in axes if first[axis] == counts[0]]) == 1:
        axes = exact
    if len(axes) > 1:
        raise UserError(f"{shown}: its width is ambiguous: state it with layout='bnc', 'bcn' or 'bcn1'")
    found = known.get((len(first), axes[0])) if axes else None
    if found is None or first[0] != rows or (len(first) == 4 and first[3] != 1):
        raise UserError(other)
    return found, first[3 - axes[0]], first[axes[0]] // counts[0]


def _multiple(axis: int, counts: Sequence[int], shapes: Sequence[Shape]) -> bool:
    """Return whether an axis has the same whole multiple of the number of points in each pass."""
    if any(len(shape) <= axis for shape in shapes):
        return False
    multiples = {divmod(shape[axis], count) for shape, count in zip(shapes, counts, strict=True)}
    times, left = min(multiples)
    return len(multiples) == 1 and left == 0 and 1 <= times <= MOST_FEATURES


def hint(rows: int, counts: Sequence[int], passes: Sequence[Observation]) -> str:
    """Name the layers of a network that can be grafted, the widest of them, in the order of its modules."""
    found: list[tuple[str, int, int]] = []
    for name in passes[0].outputs:
        outputs = [observation.outputs[name] for observation in passes]
        if all(len(calls) == 1 and isinstance(calls[0], tuple) for calls in outputs):
            try:
                _, width, multiple = find_features(name, rows, counts, [calls[0] for calls in outputs], None)
            except UserError:
                continue
            if width >= NARROW:
                found.append((name, width, multiple))
    chosen = sorted(found, key=lambda one: (-one[1], one[0].count(".")))[:HINTS]
    named = [f"'{name}' ({width} channels)" for name, width, multiple in found if (name, width, multiple) in chosen]
    return f"It can be grafted at {', '.join(named)}" if named else "It has no layer that can be grafted"


def check_calls(at: str, calls: Sequence[Any]) -> None:
    """Check that a layer was called once and gave a tensor.

    Raises:
        UserError: it was not, or did not.
    """
    if len(calls) != 1:
        raise UserError(
            f"layer '{at}' is called {len(calls)} times in one pass, and touch is fused at one call: graft at a layer "
            f"that is called once (a compiled or scripted network calls none of its layers)"
        )
    if not isinstance(calls[0], tuple):
        raise UserError(f"layer '{at}' gives a {calls[0].__name__}, not a tensor: graft at another layer")
