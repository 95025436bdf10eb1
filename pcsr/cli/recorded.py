"""`pcsr recorded`: commands about recordings of touches. A command's module is imported when it is called."""

import importlib

import click

from pcsr.cli import BuiltIn

SUBCOMMANDS = {
    "check": BuiltIn("pcsr.cli.recorded_check:check", "Check a recording, and show what its touches hold."),
}


class Subcommands(click.Group):
    """Group of the commands in `SUBCOMMANDS`."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """List the commands in the order of `SUBCOMMANDS`."""
        return list(SUBCOMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import one command."""
        if cmd_name not in SUBCOMMANDS:
            return None
        module, _, attribute = SUBCOMMANDS[cmd_name].target.partition(":")
        command: click.Command = getattr(importlib.import_module(module), attribute)
        return command

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the names and summaries of the commands without importing any of them."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, command.summary) for name, command in SUBCOMMANDS.items()])


@click.group(cls=Subcommands)
def recorded() -> None:
    """Check recordings of touches."""
