"""`pcsr report`: the reports of finished runs, made again."""

from pathlib import Path

import click

from pcsr.cli.options import FILE
from pcsr.errors import UserError


@click.command()
@click.argument("runs", nargs=-1, required=True, type=FILE, metavar="RUN...")
@click.option(
    "-o", "--out", type=FILE, default=None, metavar="FILE", help="HTML page to write.  [default: RUN/report.html]"
)
@click.option("--runs", "inside", type=FILE, default=Path("runs"), show_default=True, help="Folder of the run folders.")
def report(runs: tuple[Path, ...], out: Path | None, inside: Path) -> None:
    """Write the reports of finished runs again.

    RUN is a run folder, its name, or the beginning of its name. The page is made from its files alone;
    nothing is computed.
    """
    from pcsr.extras import require
    from pcsr.report import write_page
    from pcsr.run_files import check_run_folder, read_run
    from pcsr.run_folders import find_run

    if out is not None and len(runs) > 1:
        raise UserError(f"--out {out}: it is the page of one run, and {len(runs)} are named: leave it out")
    folders = [find_run(run, inside) for run in runs]
    for folder in folders:
        check_run_folder(folder)
    require({"plotly": "the report"})
    for finished in [read_run(folder) for folder in folders]:
        click.echo(str(write_page(finished, out)))
