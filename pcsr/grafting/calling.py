"""How a network is called as an upsampler, and which of its outputs are clouds."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from torch import Tensor

from pcsr.errors import UserError
from pcsr.tensors import Dense

DEEPEST = 4
"""Largest depth of nested tuples, lists and mappings in which clouds are searched."""


@dataclass(frozen=True)
class Calling:
    """How a network is called as an upsampler."""

    count: int
    """Number of points of a cloud at the probe."""
    rate: int | None
    """Number of points of the dense cloud for each of them; None if no output is a cloud."""
    arguments: Sequence[Any] = ()
    """Arguments besides the points, by position."""
    keywords: Mapping[str, Any] = field(default_factory=dict)
    """Arguments by keyword."""


def clouds(result: Any, rows: int, count: int) -> list[Dense]:
    """Return the clouds among the outputs of a network, in their order: tensors (b kn 3) or (b 3 kn) for n points.

    Args:
        result: output of the network: a tensor, or nested tuples, lists and mappings with tensors.
        rows: b, the number of clouds in a batch.
        count: n, the number of points of a cloud.

    Returns:
        The clouds, channels last.
    """
    found = []
    for one in _tensors(result, DEEPEST):
        if one.dim() == 3 and one.shape[0] == rows and one.is_floating_point():
            if one.shape[2] == 3 and one.shape[1] % count == 0:
                found.append(one)
            elif one.shape[1] == 3 and one.shape[2] % count == 0:
                found.append(one.transpose(1, 2))
    return found


def dense_rate(result: Any, rows: int, count: int) -> int | None:
    """Return the number of points of the largest cloud among the outputs for each point; None if there is no cloud."""
    return max((one.shape[1] // count for one in clouds(result, rows, count)), default=None)


def dense_clouds(name: str, result: Any, rows: int, count: int, rate: int) -> list[Dense]:
    """Return the dense cloud among the outputs of a network last, after the intermediate ones.

    Raises:
        UserError: there is no cloud of `rate` times as many points.
    """
    found = clouds(result, rows, count)
    dense = [index for index, one in enumerate(found) if one.shape[1] == rate * count]
    if not dense:
        given = ", ".join(str(tuple(one.shape)) for one in _tensors(result, DEEPEST)) or f"a {type(result).__name__}"
        raise UserError(
            f"{name} gives {given[:200]} for {rows} × {count} points, and no cloud of {rate * count} points, as rate "
            f"{rate} asks for: set the rate that it has"
        )
    coarse = [one for one in found[: dense[-1]] if count < one.shape[1] <= rate * count]
    return [*coarse, found[dense[-1]].contiguous()]


def _tensors(result: Any, depth: int) -> Iterator[Tensor]:
    if isinstance(result, Tensor):
        yield result
    elif depth and isinstance(result, Mapping | Sequence) and not isinstance(result, str):
        for one in result.values() if isinstance(result, Mapping) else result:
            yield from _tensors(one, depth - 1)
