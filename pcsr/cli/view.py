"""`pcsr view`: open a window with clouds side by side."""

from pathlib import Path

import click

from pcsr.cli.options import FILE


@click.command()
@click.argument("clouds", nargs=-1, required=True, type=FILE)
def view(clouds: tuple[Path, ...]) -> None:
    """Open a window with clouds side by side.

    CLOUDS are files of clouds. The command needs the extra [open3d] and a desktop.
    """
    from pcsr.clouds.formats import read_cloud
    from pcsr.clouds.reconstruction import open3d, show

    open3d()  # fails, where it is not installed, before files are read
    show([(path.name, read_cloud(path)) for path in clouds])
