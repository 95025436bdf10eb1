"""Choice of runs by their values: the option `--where`."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, TypeVar

import click

from pcsr.errors import UserError, did_you_mean

if TYPE_CHECKING:
    from pcsr.run_folders import RunFolder

Result = TypeVar("Result")


def where_option(command: Callable[..., Result]) -> Callable[..., Result]:
    """Add the option `--where` to a command, which gets its values as `conditions`."""
    return click.option(
        "--where",
        "conditions",
        multiple=True,
        metavar="KEY=PATTERN",
        help="Only runs whose value matches: name, state, seed, version, a part such as fusion, or a key of the recipe "
        "such as train.epochs. May be repeated.",
    )(command)


def chosen(every: "Sequence[RunFolder]", conditions: Sequence[str]) -> "list[RunFolder]":
    """Return the runs that meet all conditions.

    Raises:
        UserError: a condition has no `=`, or no run has its key.
    """
    found = list(every)
    for condition in conditions:
        key, equals, pattern = condition.partition("=")
        if not equals or not key:
            raise UserError(f"--where {condition}: write KEY=PATTERN, for example --where fusion=iterative")
        check_key("--where", key, every)
        found = [run for run in found if run.matches(key, pattern)]
    return found


def check_key(option: str, key: str, every: "Sequence[RunFolder]") -> None:
    """Check that a run has a value.

    Raises:
        UserError: there are runs, and none has such a value.
    """
    from pcsr.run_folders import SHORT_KEYS

    if every and all(run.value(key) is None for run in every):
        known = {
            "name",
            "state",
            "age",
            "size",
            "version",
            "seed",
            *SHORT_KEYS,
            *(m for run in every for m in run.means),
        }
        if key not in known:
            hint = did_you_mean(key, known)
            if not hint.startswith("did"):  # all short names
                hint += ", and keys of the recipe such as train.epochs"
            raise UserError(f"{option} {key}: no run has such a value: {hint}")
