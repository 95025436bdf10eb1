"""`pcsr runs rm`: remove run folders."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import click

from pcsr.cli.options import FILE
from pcsr.cli.runs_where import chosen, where_option
from pcsr.errors import RunError, UserError


@click.command("rm")
@click.argument("named", nargs=-1, type=FILE, metavar="[RUN...]")
@where_option
@click.option("--yes", is_flag=True, help="Do not ask.")
@click.pass_obj
def remove(runs: Path, named: tuple[Path, ...], conditions: tuple[str, ...], yes: bool) -> None:
    """Remove run folders with all of their files.

    RUN is a run folder, its name, the beginning of its name, or a pattern in quotes. With --where, only those of the
    named runs, or of all runs, that match are removed. Lists the runs and asks. Weights that other recipes name are
    removed too.
    """
    from pcsr.limits import gigabytes
    from pcsr.run_folders import RunFolder, find_runs, run_folders

    if not named and not conditions:
        raise UserError("no run is named: name one, a pattern such as 'smoke-*', or --where KEY=PATTERN")
    if named:
        each = dict.fromkeys(folder for one in named for folder in find_runs(one, runs))
        found = [RunFolder.read(folder) for folder in each]
    else:
        found = run_folders(runs)
    found = chosen(found, conditions)
    if not found:
        raise UserError(f"no run matches {' and '.join(conditions)}: pcsr runs --where lists those that do")
    folders = [run.folder for run in found]
    for folder in folders:
        if folder.is_symlink():
            raise UserError(f"{folder} is a link: remove the folder that it points to, {folder.resolve()}")
    for run in found:
        click.echo(f"{run.folder}: {run.state}, {gigabytes(run.size)}")
    if not yes:
        count = "this run" if len(found) == 1 else f"these {len(found)} runs"
        click.confirm(f"Remove {count}?", abort=True)
    _remove(folders)


def _remove(folders: Sequence[Path]) -> None:
    """Remove folders. Each is renamed first, so that an interruption leaves no half of a run.

    Raises:
        RunError: a folder can't be removed.
    """
    for folder in folders:
        whole = folder.absolute()  # `.` has no name
        aside = whole.with_name(f".{whole.name}.removed")
        try:
            whole.rename(aside)
            shutil.rmtree(aside)
        except OSError as error:
            raise RunError(f"{folder} can't be removed: {error.strerror or error}") from error
        click.echo(f"removed {folder}")
