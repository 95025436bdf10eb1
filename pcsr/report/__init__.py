"""Report of runs: an HTML page for one or several, tables for the terminal, and figures as PNG files."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pcsr.errors import UserError
from pcsr.files import write_bytes, write_text
from pcsr.report.run_set import run_set
from pcsr.report.tables.comparison import compare
from pcsr.report.tables.run_table import summary, table
from pcsr.report.web.comparison_page import comparison_page
from pcsr.report.web.document import plotly_source
from pcsr.report.web.page import render
from pcsr.run_files import FinishedRun

__all__ = ["compare", "summary", "table", "write_comparison", "write_figures", "write_page"]

REPORT = "report.html"


def write_page(run: FinishedRun) -> Path:
    """Write the HTML page of a run into its folder, whole or not at all.

    Returns:
        Path of the page.

    Raises:
        UserError: the extra `[report]` is not installed.
        RunError: the page can't be written.
    """
    write_text(run.folder / REPORT, render(run, plotly=plotly_source()))
    return run.folder / REPORT


def write_comparison(runs: Sequence[FinishedRun], name: str, folder: Path) -> Path:
    """Write the HTML page of several runs, whole or not at all, with their figures or the reason why there are none.

    Args:
        runs: at least one.
        name: name of the study, and of the page.
        folder: folder of the page, which holds the run folders too.

    Returns:
        Path of the page.

    Raises:
        RunError: the page can't be written.
    """
    figures: dict[str, bytes] | str
    try:
        figures = _figures(runs, "webp")
    except UserError as error:
        figures = str(error)
    path = folder / f"{name}.html"
    write_text(path, comparison_page([run.results for run in runs], name, figures))
    return path


def write_figures(runs: Sequence[FinishedRun], folder: Path) -> list[Path]:
    """Write the figures of runs (`pcsr.report.figures.paper`) as PNG files; all are drawn before one is written.

    Args:
        runs: runs on the same clouds.
        folder: folder of the files.

    Returns:
        Paths of the files.

    Raises:
        UserError: the runs are not on the same clouds, or the extra `[report]` is not installed.
        RunError: a file can't be written.
    """
    files = {folder / f"{name}.png": data for name, data in _figures(runs, "png").items()}
    for path, data in files.items():
        write_bytes(path, data)
    return list(files)


def _figures(runs: Sequence[FinishedRun], form: Literal["png", "webp"]) -> dict[str, bytes]:
    """Image files of the figures of runs, by name.

    Raises:
        UserError: the runs are not on the same clouds, or the extra `[report]` is not installed.
    """
    from pcsr.report.figures.canvas import encoded
    from pcsr.report.figures.paper import figures

    return {name: encoded(figure, form) for name, figure in figures(run_set(runs)).items()}
