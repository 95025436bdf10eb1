"""`pcsr plugins`: list the parts that recipes may name, with the plugins that register them."""

from typing import TYPE_CHECKING, Any

import click

from pcsr.cli import COMMANDS, foreign_commands, streams
from pcsr.cli.options import listed_plugin_option
from pcsr.cli.plugin_check import check
from pcsr.cli.plugin_new import new

if TYPE_CHECKING:
    from rich.table import Table

    from pcsr.plugins.registry import Entry, Registry


@click.group(invoke_without_command=True)
@click.option("--why", "name", metavar="NAME", help="Explain where a part comes from, or why it is missing.")
@listed_plugin_option
@click.pass_context
def plugins(context: click.Context, name: str | None, registry: "Registry") -> None:
    """List, check and write plugins and their parts.

    Without a command, lists the parts that recipes may name, with the distribution or file that registers each.
    """
    command = context.invoked_subcommand
    if command is not None:
        if name is not None or registry.files:
            raise click.UsageError(f"options go behind the subcommand: pcsr plugins {command} … --plugin FILE", context)
        return
    if name is not None:
        from pcsr.plugins.loading import why

        click.echo(why(registry, name))
        return
    console = streams.console()
    console.print(_table(registry))
    for command, announced in foreign_commands().items():
        owners = " and ".join(owner for owner, _ in announced)
        note = " (not reachable: pcsr has a built-in command of this name)" if command in COMMANDS else ""
        console.print(f"command {command} comes from {owners}{note}", markup=False, soft_wrap=True)
    for failure in registry.failures:
        console.print(
            f"{failure.owner} {failure.version} failed to load: {failure.message} (pcsr plugins --why {failure.owner})",
            style="red",
            markup=False,
            soft_wrap=True,
        )


def _table(registry: "Registry") -> "Table":
    from rich.table import Column, Table

    table = Table(*(Column(head, overflow="fold") for head in ("kind", "name", "owner", "version", "traits")))
    for entry in registry:
        table.add_row(entry.kind, entry.name, entry.owner, entry.version, _traits(entry))
    return table


def _traits(entry: "Entry") -> str:
    """Return the traits that a part declares, or the error if it cannot be loaded."""
    from rich.markup import escape

    from pcsr.errors import UserError

    try:
        part: type[Any] = entry.load()
    except UserError as error:
        return f"[red]{escape(str(error))}[/red]"
    return ", ".join(sorted(part.traits))


plugins.add_command(check)
plugins.add_command(new)
