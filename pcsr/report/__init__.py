"""The report of a run: one self-contained page, the table of its numbers for the screen, and pictures as PNG files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from PIL.Image import Image

from pcsr.errors import UserError
from pcsr.files import write_text
from pcsr.report.comparison import compare, folder_of, page
from pcsr.report.page import plotly_source, render
from pcsr.report.results import parse_results, read_examples, read_history, read_results
from pcsr.report.table import table

__all__ = ["compare", "table", "write", "write_comparison", "write_figures"]

REPORT = "report.html"


def write(run: Path) -> Path:
    """Write the report of a run folder into it, whole or not at all.

    Args:
        run: a folder with `results.json` and `examples.safetensors`, and `metrics.jsonl` if the run trained.

    Returns:
        The path of the page.

    Raises:
        UserError: a file of the folder is missing or malformed, or the extra `[report]` is not installed.
        RunError: the page can't be written.
    """
    results = read_results(run / "results.json")
    examples = read_examples(run / "examples.safetensors", [method.name for method in results.methods])
    page = render(results, examples, read_history(run / "metrics.jsonl"), plotly=plotly_source())
    write_text(run / REPORT, page)
    return run / REPORT


def write_comparison(runs: Sequence[dict[str, Any]], name: str, folder: Path) -> Path:
    """Write the tables of several runs as one page into a folder, whole or not at all.

    The page shows their figures too, or says why there are none.

    Args:
        runs: what each run's `results.json` holds.
        name: the study's, and the page's.
        folder: where the run folders are.
    """
    from pcsr.report.figures import figures

    drawn: Mapping[str, Image] | str
    try:
        drawn = figures([folder / folder_of(parsed) for parsed in map(parse_results, runs)])
    except UserError as error:
        drawn = str(error)
    path = folder / f"{name}.html"
    write_text(path, page(runs, name, drawn))
    return path


def write_figures(runs: Sequence[Path], folder: Path) -> list[Path]:
    """Draw the figures of runs (`pcsr.report.figures`), all of them before the first is written.

    Args:
        runs: their folders, each with `results.json` and `examples.safetensors`, and `metrics.jsonl` if it trained.
        folder: where the PNG files go.

    Returns:
        The paths of the files.

    Raises:
        UserError: a file of a folder is missing or malformed, or the runs are not of the same clouds.
        RunError: a file can't be written.
    """
    from pcsr.report.figures import figures
    from pcsr.report.lettering import save_png

    drawn = {folder / f"{name}.png": image for name, image in figures(runs).items()}
    for path, image in drawn.items():
        save_png(image, path)
    return list(drawn)
