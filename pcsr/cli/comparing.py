"""Tables of several runs: on the screen, as a page, and as files of LaTeX, Markdown and CSV."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from pcsr.cli import streams
from pcsr.cli.options import FILE
from pcsr.errors import RunError, UserError

if TYPE_CHECKING:
    from pcsr.run_files import FinishedRun

Result = TypeVar("Result")

FORMATS = {"latex": "LaTeX, with booktabs and graphicx", "markdown": "Markdown", "csv": "CSV, with unrounded numbers"}
"""Formats of tables, each of which is an option of the command line."""


def table_options(command: Callable[..., Result]) -> Callable[..., Result]:
    """Add the options `FORMATS` to a command."""
    for name, text in reversed(FORMATS.items()):
        command = click.option(
            f"--{name}", type=FILE, default=None, metavar="FILE", help=f"Write the tables to this file as {text}."
        )(command)
    return command


def table_files(options: dict[str, Any]) -> dict[str, Path]:
    """Return the files that the options of `table_options` name, by format, after a check that needs no tables.

    Raises:
        UserError: two are the same file, one cannot be a file, or is a file of a run.
    """
    from pcsr.files import check_target
    from pcsr.run_files import is_file_of_run

    files = {form: options[form] for form in FORMATS if options[form] is not None}
    named: dict[str, str] = {}
    for form, path in files.items():
        check_target(path)
        if is_file_of_run(path):
            raise UserError(f"--{form}: {path} is a file of a run, which the tables would replace: name another")
        if (other := named.setdefault(os.path.realpath(path), form)) != form:
            raise UserError(f"--{other} and --{form} name the same file, {path}: name two")
    return files


def read_runs(folders: Sequence[Path]) -> "tuple[list[FinishedRun | None], list[str]]":
    """Read run folders. One without usable results is left out, with a line on standard error.

    Returns:
        The runs in the order of the folders, None for those left out; and the reasons, one for each of these.

    Raises:
        UserError: a folder is named twice, or is no run folder.
    """
    from pcsr.run_files import check_run_folder, read_results_of

    runs: list[FinishedRun | None] = []
    reasons: list[str] = []
    for number, folder in enumerate(folders):
        if folder.resolve() in [other.resolve() for other in folders[:number]]:
            raise UserError(f"{folder} is named twice: name each run once")
        check_run_folder(folder)
        try:
            runs.append(read_results_of(folder))
        except UserError as error:
            reasons.append(str(error).partition(";")[0])  # without the remedy
            streams.console(error=True).print(f"left out: {error}", markup=False, soft_wrap=True, highlight=False)
            runs.append(None)
    return runs, reasons


def show(
    runs: "Sequence[FinishedRun]",
    left_out: Sequence[str],
    name: str,
    folder: Path,
    files: dict[str, Path] | None = None,
) -> None:
    """Write the tables of runs to a page and to files, and print them.

    Args:
        runs: the runs, at least one.
        left_out: reasons why runs are missing.
        name: name of the page.
        folder: folder of the page.
        files: files to write, by the names of `FORMATS`.

    Raises:
        UserError: the runs have no metric in common.
        RunError: a file can't be written.
    """
    from pcsr import report

    console = streams.console()
    compared = report.comparison([one.results for one in runs], name, left_out)
    # Before anything is printed, as the reader of a pipe may end after a few lines.
    for kind, path in (files or {}).items():
        report.write_tables(compared, kind, path)
    page = report.write_comparison(compared, runs, folder)
    for table in report.tables(compared):
        console.print(table)
    for kind, path in (files or {}).items():
        console.print(f"{kind}: {path}", soft_wrap=True, markup=False, highlight=False)
    console.print(f"all runs: {page}", soft_wrap=True, markup=False, highlight=False)


def check_failed(failed: Sequence[str], total: int) -> None:
    """End a command in whose runs some failed.

    Raises:
        RunError: there is such a run.
    """
    if failed:
        raise RunError(f"{len(failed)} of {total} runs failed, see above: the same command runs them again")
