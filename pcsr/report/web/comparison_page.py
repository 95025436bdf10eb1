"""Comparison of several runs as an HTML page: tables, figures, settings that differ, and links to the runs' reports."""

import html
from base64 import b64encode
from collections.abc import Mapping, Sequence

from pcsr.report.tables.comparison import compare, differences
from pcsr.report.web.document import document, text_table
from pcsr.results import Results


def comparison_page(runs: Sequence[Results], name: str, figures: Mapping[str, bytes] | str) -> str:
    """HTML page of a study.

    Args:
        runs: at least one.
        name: name of the study.
        figures: WebP files by name, or the reason why there are none.
    """
    different = differences(runs)
    tables = [*compare(runs, name), *([] if different is None else [different])]
    body = f"<h1>{html.escape(name)}</h1>" + "".join(map(text_table, tables)) + _figures(figures) + _reports(runs)
    return document(name, body)


def _figures(figures: Mapping[str, bytes] | str) -> str:
    if isinstance(figures, str):
        return f'<section><h2>Figures</h2><p class="note">None: {html.escape(figures)}</p></section>'
    shown = "".join(
        f'<p><img alt="{html.escape(name)}" style="max-width: 100%" '
        f'src="data:image/webp;base64,{b64encode(image).decode()}"></p>'
        for name, image in figures.items()
    )
    return f"<section><h2>Figures</h2>{shown}</section>"


def _reports(runs: Sequence[Results]) -> str:
    """Links to the reports of the runs, whose folders are beside the page, with version, date and machine."""
    links = "".join(
        f'<li><a href="{html.escape(run.folder_name)}/report.html">{html.escape(run.name)}</a>, '
        f"pcsr {html.escape(run.version)}, {html.escape(run.created)}, "
        f"{html.escape(run.machine)}</li>"
        for run in runs
    )
    return f"<section><h2>Reports</h2><ul>{links}</ul></section>"
