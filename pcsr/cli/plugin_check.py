"""`pcsr plugins check`: hold a part to the contract of its kind."""

import itertools
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pcsr.cli.check_process import Job, item, outcomes
from pcsr.cli.options import FILE, SECONDS, winning_plugin_option
from pcsr.errors import RunError, UserError, did_you_mean

if TYPE_CHECKING:
    from pcsr.plugins.registry import Entry, Registry
    from pcsr.testing import Outcome


@click.command()
@click.argument("name")
@click.option("--kind", default=None, metavar="KIND", help="Only the part of this kind, where several have the name.")
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="An option of the part: --set channels=32. The value is YAML. May be repeated.",
)
@click.option("--mesh", type=FILE, default=None, help="What a touch source is to touch.  [default: an egg, 60 mm long]")
@click.option("--upsampler", default=None, metavar="NAME", help="What an objective is made for, if not for any.")
@click.option(
    "--time-limit",
    type=SECONDS,
    default=60.0,
    show_default=True,
    metavar="SECONDS",
    help="Of each check; one that runs on has failed.",
)
@winning_plugin_option
def check(
    name: str,
    kind: str | None,
    overrides: tuple[str, ...],
    mesh: Path | None,
    upsampler: str | None,
    time_limit: float,
    registry: "Registry",
) -> None:
    """Check whether a part keeps the contract of its kind.

    NAME is a part's, or a plugin's for all of its parts. Of a part that --plugin FILE brings too, that file's is
    checked. Every check prints a line; a failure says what was found, what
    is expected and what to do.
    """
    from pcsr.extras import require

    entries = _found(name, kind, registry)
    require({package: user for entry in entries for package, user in _needs(entry).items()})
    # Mistakes in the options are told before the first check takes its time.
    if mesh is not None:
        item(mesh)
    if upsampler is not None:
        registry.get("upsampler", upsampler)
    jobs = []
    for entry in entries:
        entry.load()
        job = Job(entry.kind, entry.name, _options(entry, overrides))
        if entry.kind == "touch":
            job = replace(job, mesh=mesh)
        elif entry.kind == "objective":
            job = replace(job, upsampler=upsampler)
        jobs.append(job)
    of_parts = itertools.groupby(outcomes(jobs, registry.files, time_limit), lambda pair: pair[0])
    failed = [entries[number] for number, pairs in of_parts if not _show(entries[number], (one for _, one in pairs))]
    if failed:
        names = ", ".join(f"{entry.kind} '{entry.name}'" for entry in failed)
        raise RunError(f"{names} failed: what to do stands beside each check that did")


def _found(name: str, kind: str | None, registry: "Registry") -> "list[Entry]":
    """The parts that are meant.

    Raises:
        UserError: none; the message says why.
    """
    from pcsr.plugins.loading import why
    from pcsr.plugins.registry import FILE, KINDS

    if kind is not None and kind not in KINDS:
        raise UserError(f"--kind {kind}: there is no such kind: {did_you_mean(kind, KINDS)}")
    named = [entry for entry in registry if name in (entry.name, entry.owner, entry.brought_by)]
    named = [entry for entry in named if entry.version == FILE] or named  # a file that is handed in is meant
    found = [entry for entry in named if kind in (None, entry.kind)]
    if found:
        return found
    if named:
        raise UserError(f"--kind {kind}: '{name}' is no {kind}, but {', '.join(dict.fromkeys(e.kind for e in named))}")
    if any(failure.owner == name for failure in registry.failures):
        raise UserError(why(registry, name))
    known = {entry.name for entry in registry if kind in (None, entry.kind)}
    failed = "".join(f"; {why(registry, failure.owner)}" for failure in registry.failures)
    raise UserError(f"there is no part and no plugin '{name}': {did_you_mean(name, known)}{failed}")


def _needs(entry: "Entry") -> dict[str, str]:
    """The packages that a part needs; none of one that cannot be loaded, of which a check will tell."""
    try:
        part: Any = entry.load()
    except UserError:
        return {}
    return dict.fromkeys(sorted(part.needs), f"{entry.kind} '{entry.name}'")


def _options(entry: "Entry", overrides: tuple[str, ...]) -> dict[str, Any]:
    """What `--set` gives, in the types of the part's options.

    Raises:
        UserError: an option that the part does not have, or a value that it does not take.
    """
    import json

    from pydantic import ValidationError

    from pcsr.mistakes import explained, shortened, shown
    from pcsr.recipe.schema import options_model
    from pcsr.recipe.source import Place, scalar

    if not overrides:  # so that a part whose options cannot be read fails a check
        return {}
    model = options_model(entry.load())
    given: dict[str, Any] = {}
    for override in overrides:
        key, equals, value = override.partition("=")
        key = key.strip()
        place = f"--set {shortened(override, 200)}"
        if not equals:
            raise UserError(f"{place}: write KEY=VALUE")
        name, *inner = key.split(".")
        if name not in model.model_fields:
            remedy = did_you_mean(name, model.model_fields)
            raise UserError(f"{place}: {entry.kind} '{entry.name}' takes no {shown(name)}: {remedy}")
        plain = scalar(value, Place(place))
        for one in reversed(inner):
            plain = {one: plain}
        both = isinstance(plain, dict) and isinstance(given.get(name), dict)
        given[name] = given[name] | plain if both else plain
    try:
        checked = model.model_validate_json(json.dumps(given))
    except (TypeError, ValidationError) as error:
        mistakes = error.errors() if isinstance(error, ValidationError) else []
        given_wrong = [one for one in mistakes if one["type"] != "missing"]
        wrong = [f"{'.'.join(map(str, one['loc']))}: {explained([one])}" for one in given_wrong]
        if not mistakes or wrong:
            raise UserError(f"--set, for {entry.kind} '{entry.name}': {'; '.join(wrong) or error}") from error
        return given  # what is missing the check `builds` tells
    return {key: getattr(checked, key) for key in given}


def _show(entry: "Entry", came: "Iterable[Outcome]") -> bool:
    """Print what comes of the checks of a part, a line each; whether none failed."""
    click.echo(f"{entry.kind} '{entry.name}' of {entry.owner} {entry.version}")
    counts = {"passed": 0, "skipped": 0, "failed": 0}
    for outcome in came:
        counts[outcome.result] += 1
        said = f": {outcome.said}" if outcome.said else ""
        mark = "FAILED" if outcome.result == "failed" else outcome.result
        click.echo(f"  {mark:7} {outcome.check}{said}")
    click.echo(f"  {', '.join(f'{count} {result}' for result, count in counts.items())}")
    return not counts["failed"]
