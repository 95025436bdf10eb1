"""Comparison of several runs as an HTML page: tables, figures, settings that differ, and links to the runs' reports."""

import html
import os
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from urllib.parse import quote

from pcsr.counted import counted
from pcsr.report.colours import row_colours
from pcsr.report.tables.comparison import Comparison
from pcsr.report.tables.comparison_tables import paper_tables, tables
from pcsr.report.tables.markup import comma_separated, latex, markdown
from pcsr.report.tables.settings import settings_that_differ
from pcsr.report.web.difference_chart import difference_chart
from pcsr.report.web.document import document, text_table
from pcsr.results import Results


def comparison_page(
    compared: Comparison, folders: Sequence[Path], beside: Path, figures: Mapping[str, bytes] | str
) -> str:
    """HTML page of a comparison.

    Args:
        compared: the numbers.
        folders: run folder of each run.
        beside: folder of the page, from which the reports are linked.
        figures: WebP files by name, or the reason why there are none.
    """
    colours = row_colours(compared.rows)
    by_label = {row.marked: colour for row, colour in zip(compared.rows, colours, strict=True)}
    first, *others = tables(compared)
    different = settings_that_differ(compared)
    body = "".join(
        (
            f'<h1>{html.escape(compared.name)}</h1><p class="lead">{_lead(compared)}</p>',
            text_table(replace(first, title="Results"), by_label),
            difference_chart(compared, colours),
            *(text_table(table, by_label) for table in others),
            "" if different is None else text_table(different, by_label, words=True),
            _figures(figures, compared),
            _reports(compared.runs, folders, beside),
        )
    )
    return document(compared.name, body)


def _lead(compared: Comparison) -> str:
    """Number of runs, and the tables as files that the page holds."""
    written = {
        "csv": ("text/csv", comma_separated(compared)),
        "tex": ("application/x-tex", latex(paper_tables(compared), compared.name)),
        "md": ("text/markdown", markdown(tables(compared))),
    }
    links = ", ".join(
        f'<a download="{html.escape(compared.name)}.{suffix}" href="data:{kind};charset=utf-8;base64,'
        f'{b64encode(text.encode()).decode()}">{name}</a>'
        for name, (suffix, (kind, text)) in zip(("CSV", "LaTeX", "Markdown"), written.items(), strict=True)
    )
    return f"{counted(len(compared.runs), 'run')}. The tables as files: {links}."


def _figures(figures: Mapping[str, bytes] | str, compared: Comparison) -> str:
    if isinstance(figures, str):
        return f'<section><h2>Figures</h2><p class="note">None: {html.escape(figures)}</p></section>'
    shown = "".join(
        f'<p><img alt="{html.escape(name)}" style="max-width: 100%; height: auto" '
        f'src="data:image/webp;base64,{b64encode(image).decode()}"></p>'
        for name, image in figures.items()
    )
    note = ""
    if compared.over_seeds:
        note = '<p class="note">Clouds are those of the first seed of each row; lines are of all seeds.</p>'
    return f"<section><h2>Figures</h2>{note}{shown}</section>"


def _reports(runs: Sequence[Results], folders: Sequence[Path], beside: Path) -> str:
    """Links to the reports of the runs, with version, date and machine."""
    links = "".join(
        f'<li><a href="{html.escape(_link(folder / "report.html", beside))}">{html.escape(run.name)}</a>, '
        f"pcsr {html.escape(run.version)}, {html.escape(run.created)}, "
        f"{html.escape(run.machine)}</li>"
        for run, folder in zip(runs, folders, strict=True)
    )
    return f"<section><h2>Reports</h2><ul>{links}</ul></section>"


def _link(file: Path, beside: Path) -> str:
    """Link from a page in a folder to a file: relative, or absolute where it lies on another drive."""
    try:
        return quote(Path(os.path.relpath(file, beside)).as_posix())
    except ValueError:
        return file.resolve().as_uri()
