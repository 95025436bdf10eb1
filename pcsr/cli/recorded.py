"""`pcsr recorded`: recordings of touches."""

import click

from pcsr.cli.recorded_check import check
from pcsr.cli.recorded_import import import_


@click.group()
def recorded() -> None:
    """Check recordings of touches, and import them from ROS bags."""


recorded.add_command(check)
recorded.add_command(import_)
