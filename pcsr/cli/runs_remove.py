"""`pcsr runs rm`: remove run folders."""

import shutil
from collections.abc import Sequence
from pathlib import Path

import click

from pcsr.cli.options import FILE
from pcsr.cli.runs_where import chosen, where_option
from pcsr.errors import RunError, UserError, printable


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
        _check_nothing_else(folder)
    for run in found:
        click.echo(printable(f"{run.folder}: {run.state}, {gigabytes(run.size)}", lines=False))
    if not yes:
        count = "this run" if len(found) == 1 else f"these {len(found)} runs"
        click.confirm(f"Remove {count}?", abort=True)
    _remove(folders)


def _check_nothing_else(folder: Path) -> None:
    """Check that a folder with files of a run is not one of runs or of a project, into which such a file got.

    Raises:
        UserError: it holds run folders or a git repository.
    """
    from pcsr.run_files import is_run_folder

    for path in sorted(folder.iterdir()):
        if path.name == ".git" or (path.is_dir() and is_run_folder(path)):
            what = "a git repository" if path.name == ".git" else f"another run, {path.name}"
            raise UserError(f"{folder} holds {what}: remove files of a run from it by hand")


def _remove(folders: Sequence[Path]) -> None:
    """Remove folders. Each is renamed first, so that an interruption leaves no half of a run.

    Raises:
        RunError: a folder can't be removed.
    """
    for folder in folders:
        whole = folder.absolute()  # `.` has no name
        aside = whole.with_name(f".{whole.name}.removed")
        try:
            if aside.exists():  # left by an interrupted removal
                shutil.rmtree(aside)
            whole.rename(aside)
            shutil.rmtree(aside)
        except OSError as error:
            raise RunError(f"{folder} can't be removed: {error.strerror or error}") from error
        click.echo(printable(f"removed {folder}", lines=False))
