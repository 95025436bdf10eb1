"""`pcsr recorded`: recordings of touches."""

import click

from pcsr.cli.recorded_check import check


@click.group()
def recorded() -> None:
    """Check recordings of touches."""


recorded.add_command(check)
