"""`pcsr plugins check`: check that parts keep the contract of their kind."""

import itertools
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from pcsr.cli.check_process import Job, item, outcomes
from pcsr.cli.options import FILE, SECONDS, complete_part, winning_plugin_option
from pcsr.errors import RunError, UserError, did_you_mean

if TYPE_CHECKING:
    from pcsr.plugins.registry import Entry, Registry
    from pcsr.testing import Outcome

LONGEST_LIST = 300
"""Length of a list of known names above which a message refers to the command that prints it."""


@click.command()
@click.argument("name")
@click.option("--kind", default=None, metavar="KIND", help="Check only parts of this kind.")
@click.option(
    "--set",
    "overrides",
    multiple=True,
    metavar="KEY=VALUE",
    help="Set an option of the part, such as channels=32. The value is YAML. May be repeated.",
)
@click.option(
    "--mesh",
    type=FILE,
    default=None,
    metavar="FILE",
    help="Check touch sources on this mesh.  [default: an egg, 60 mm long]",
)
@click.option(
    "--upsampler",
    default=None,
    metavar="NAME",
    shell_complete=complete_part("upsampler"),
    help="Check objectives with this upsampler, for those that need a particular one.",
)
@click.option(
    "--time-limit",
    type=SECONDS,
    default=60.0,
    show_default=True,
    metavar="SECONDS",
    help="Time limit of each check; a check that exceeds it has failed.",
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
    """Check that parts keep the contract of their kind.

    NAME is the name of a part, or of a plugin, whose parts are all checked. If an installed plugin and --plugin both
    bring a part of this name, the file's part is checked. Each check prints one line; that of a failure says what was
    found, what is expected, and how to mend it.
    """
    from pcsr.extras import require

    entries = _found(name, kind, registry)
    require({package: user for entry in entries for package, user in _needs(entry).items()})
    # Mistakes in the options are reported before the first check runs.
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
        raise RunError(f"{names} failed: the line of each failed check says how to mend it")


def _found(name: str, kind: str | None, registry: "Registry") -> "list[Entry]":
    """Find the parts that the command checks.

    Raises:
        UserError: there is none; the message says why.
    """
    from pcsr.plugins.loading import why
    from pcsr.plugins.registry import FILE, KINDS

    if kind is not None and kind not in KINDS:
        raise UserError(f"--kind {kind}: there is no such kind: {did_you_mean(kind, KINDS)}")
    named = [entry for entry in registry if name in (entry.name, entry.owner, entry.brought_by)]
    named = [entry for entry in named if entry.version == FILE] or named  # parts of --plugin files come first
    found = [entry for entry in named if kind in (None, entry.kind)]
    if found:
        return found
    if named:
        kinds = ", ".join(dict.fromkeys(entry.kind for entry in named))
        raise UserError(f"--kind {kind}: there is no {kind} '{name}', only of the kind {kinds}")
    if any(failure.owner == name for failure in registry.failures):
        raise UserError(why(registry, name))
    known = {entry.name for entry in registry if kind in (None, entry.kind)}
    failed = "".join(f"; {why(registry, failure.owner)}" for failure in registry.failures)
    near = did_you_mean(name, known)
    if len(near) > LONGEST_LIST:
        near = "pcsr plugins lists those that there are"
    raise UserError(f"there is no part and no plugin '{name}': {near}{failed}")


def _needs(entry: "Entry") -> dict[str, str]:
    """Return the packages that a part needs, each with its user; none if it cannot be loaded, which a check reports."""
    try:
        part: Any = entry.load()
    except UserError:
        return {}
    return dict.fromkeys(sorted(part.needs), f"{entry.kind} '{entry.name}'")


def _options(entry: "Entry", overrides: tuple[str, ...]) -> dict[str, Any]:
    """Return the values of `--set`, converted to the types of the part's options.

    Raises:
        UserError: the part has no such option, or the option does not accept the value.
    """
    import json

    from pydantic import ValidationError

    from pcsr.recipe.schema import options_model
    from pcsr.recipe.source import Location, scalar
    from pcsr.validation_messages import described, shortened, shown

    if not overrides:  # options that cannot be read are then reported by a check
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
        plain = scalar(value, Location(place))
        for one in reversed(inner):
            plain = {one: plain}
        both = isinstance(plain, dict) and isinstance(given.get(name), dict)
        given[name] = given[name] | plain if both else plain
    try:
        checked = model.model_validate_json(json.dumps(given))
    except (TypeError, ValidationError) as error:
        mistakes = error.errors() if isinstance(error, ValidationError) else []
        given_wrong = [one for one in mistakes if one["type"] != "missing"]
        wrong = [described([one], ".".join(map(str, one["loc"])), "", ()) for one in given_wrong]
        if not mistakes or wrong:
            raise UserError(f"--set, for {entry.kind} '{entry.name}': {'; '.join(wrong) or error}") from error
        return given  # the check `builds` reports missing options
    return {key: getattr(checked, key) for key in given}


def _show(entry: "Entry", found: "Iterable[Outcome]") -> bool:
    """Print the outcomes of a part's checks, one line each, and return whether none failed."""
    click.echo(f"{entry.kind} '{entry.name}' of {entry.owner} {entry.version}")
    counts = {"passed": 0, "skipped": 0, "failed": 0}
    for outcome in found:
        counts[outcome.result] += 1
        message = f": {outcome.reason}" if outcome.reason else ""
        mark = "FAILED" if outcome.result == "failed" else outcome.result
        click.echo(f"  {mark:7} {outcome.check}{message}")
    click.echo(f"  {', '.join(f'{count} {result}' for result, count in counts.items())}")
    return not counts["failed"]
