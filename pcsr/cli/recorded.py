"""`pcsr recorded`: recordings of touches."""

import click

from pcsr.cli.recorded_import import import_


@click.group()
def recorded() -> None:
    """Import touches that a robot recorded."""


recorded.add_command(import_)
