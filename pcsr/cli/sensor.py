"""`pcsr sensor`: camera-based tactile sensors, such as DIGIT and GelSight."""

import click

from pcsr.cli.sensor_calibrate import calibrate
from pcsr.cli.sensor_read import read


@click.group()
def sensor() -> None:
    """Calibrate camera-based tactile sensors and read their images."""


sensor.add_command(calibrate)
sensor.add_command(read)
