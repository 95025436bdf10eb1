"""Report of runs: an HTML page for one or several, tables for the terminal, and figures as PNG files."""

from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from pcsr.errors import UserError
from pcsr.files import write_bytes, write_text
from pcsr.report.run_set import run_set
from pcsr.report.tables.comparison import Comparison, comparison
from pcsr.report.tables.comparison_tables import paper_tables, tables
from pcsr.report.tables.markup import comma_separated, latex, markdown
from pcsr.report.tables.run_table import few_steps, summary, table
from pcsr.report.web.comparison_page import comparison_page
from pcsr.report.web.document import plotly_source
from pcsr.report.web.page import render
from pcsr.run_files import REPORT, FinishedRun

__all__ = [
    "REPORT",
    "Comparison",
    "comparison",
    "few_steps",
    "summary",
    "table",
    "tables",
    "write_comparison",
    "write_figures",
    "write_page",
    "write_tables",
]


def write_page(run: FinishedRun, path: Path | None = None) -> Path:
    """Write the HTML page of a run, whole or not at all.

    Args:
        run: the run.
        path: file to write; by default `report.html` in the run's folder.

    Returns:
        Path of the page.

    Raises:
        UserError: the extra `[report]` is not installed.
        RunError: the page can't be written.
    """
    path = run.folder / REPORT if path is None else path
    write_text(path, render(run, plotly=plotly_source()))
    return path


def write_comparison(compared: Comparison, runs: Sequence[FinishedRun], folder: Path) -> Path:
    """Write the HTML page of several runs, whole or not at all, with their figures or the reason why there are none.

    Args:
        compared: numbers of the runs; the page has the name of this comparison.
        runs: the runs, in the order of `compared.runs`.
        folder: folder of the page.

    Returns:
        Path of the page.

    Raises:
        RunError: the page can't be written.
    """
    figures: dict[str, bytes] | str
    try:
        figures = _figures(runs, "webp", _first_seeds(compared, runs))
    except UserError as error:
        figures = str(error)
    path = folder / f"{compared.name}.html"
    write_text(path, comparison_page(compared, [run.folder for run in runs], folder, figures))
    return path


def write_tables(compared: Comparison, form: str, path: Path) -> None:
    """Write the tables of a comparison to a file, whole or not at all.

    Args:
        compared: numbers of the runs.
        form: "latex", "markdown" or "csv".
        path: file to write.

    Raises:
        RunError: the file can't be written.
    """
    match form:
        case "latex":
            text = latex(paper_tables(compared), compared.name)
        case "markdown":
            text = markdown(tables(compared))
        case _:
            text = comma_separated(compared)
    write_text(path, text)


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


def _first_seeds(compared: Comparison, runs: Sequence[FinishedRun]) -> list[FinishedRun]:
    """The run of the lowest seed of each recipe."""
    by_results = {id(run.results): run for run in runs}
    return [by_results[id(row.runs[0])] for row in compared.rows if row.efficiencies is not None]


def _figures(
    runs: Sequence[FinishedRun], form: Literal["png", "webp"], pictured: Sequence[FinishedRun] | None = None
) -> dict[str, bytes]:
    """Image files of the figures of runs, by name; `pictured` are those whose clouds are drawn, by default all.

    Raises:
        UserError: the runs are not on the same clouds, or the extra `[report]` is not installed.
    """
    from pcsr.report.figures.canvas import encoded
    from pcsr.report.figures.paper import figures

    drawn = figures(run_set(runs), None if pictured is None else run_set(pictured))
    return {name: encoded(figure, form) for name, figure in drawn.items()}
