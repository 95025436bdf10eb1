"""The report of a run: one self-contained page, and the table of its numbers for the screen."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pcsr.files import write_text
from pcsr.report.comparison import compare, page
from pcsr.report.page import render
from pcsr.report.results import read_examples, read_history, read_results
from pcsr.report.table import table

__all__ = ["compare", "table", "write", "write_comparison"]

REPORT = "report.html"


def write(run: Path) -> Path:
    """Write the report of a run folder into it, whole or not at all.

    Args:
        run: a folder with `results.json` and `examples.safetensors`, and `metrics.jsonl` if the run trained.

    Returns:
        The path of the page.

    Raises:
        UserError: a file of the folder is missing or malformed.
        RunError: the page can't be written.
    """
    from plotly.offline import get_plotlyjs  # half a second that `pcsr --help` shouldn't wait for

    results = read_results(run / "results.json")
    examples = read_examples(run / "examples.safetensors", [method.name for method in results.methods])
    page = render(results, examples, read_history(run / "metrics.jsonl"), plotly=get_plotlyjs())
    write_text(run / REPORT, page)
    return run / REPORT


def write_comparison(runs: Sequence[dict[str, Any]], name: str, folder: Path) -> Path:
    """Write the tables of several runs as one page into a folder, whole or not at all.

    Args:
        runs: what each run's `results.json` holds.
        name: the study's, and the page's.
        folder: where the run folders are.
    """
    path = folder / f"{name}.html"
    write_text(path, page(runs, name))
    return path
