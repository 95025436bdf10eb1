"""`pcsr figures`: the figures of finished runs, as PNG files."""

from pathlib import Path

import click

from pcsr.cli.options import FILE, OUTPUT_FOLDER


@click.command()
@click.argument("runs", nargs=-1, required=True, type=FILE)
@click.option(
    "-o",
    "--out",
    type=OUTPUT_FOLDER,
    default=Path("figures"),
    show_default=True,
    metavar="DIR",
    help="Folder to write to.",
)
def figures(runs: tuple[Path, ...], out: Path) -> None:
    """Draw the figures of finished runs as PNG files.

    RUNS are run folders that were evaluated on the same clouds. Their networks are shown side by side, in this order.

    \b
    pcsr figures runs/tapsr-1a2b3c4d
    pcsr figures runs/without-5e6f7a8b runs/tapsr-1a2b3c4d -o figures/fig5
    """  # noqa: D301 (click's mark is the letter itself)
    from pcsr.extras import require
    from pcsr.report import write_figures
    from pcsr.run_files import check_run_folder, read_run

    require({"matplotlib": "a figure"})
    for folder in runs:
        check_run_folder(folder)
    for path in write_figures([read_run(folder) for folder in runs], out):
        click.echo(str(path))
