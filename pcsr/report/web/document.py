"""HTML document that needs nothing but a browser: plotly.js, the page's script and its data are embedded."""

import html
import json
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from pcsr.extras import imported
from pcsr.report.tables.text_table import TextTable


def plotly_source() -> str:
    """Source of plotly.js.

    Raises:
        UserError: the extra `[report]` is not installed.
    """
    source: str = imported("plotly.offline", "the report").get_plotlyjs()
    return source


def document(title: str, body: str, drawn: dict[str, Any] | None = None, *, plotly: str = "") -> str:
    """HTML document around a body.

    Args:
        title: plain text.
        body: HTML.
        drawn: data of page.js: `examples`, rows of views as `views` returns them, and `charts` by name. None: the
            document has no script.
        plotly: source of plotly.js.
    """
    scripts = ""
    if drawn is not None:
        body += "\n<noscript><p>The views and charts need JavaScript.</p></noscript>"
        scripts = (
            f'<script type="application/json" id="drawn">{_json(drawn)}</script>\n'
            f"<script>{plotly}</script>\n<script>\n{_asset('page.js')}</script>\n"
        )
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n"
        f"<style>\n{_asset('page.css')}</style>\n</head>\n<body>\n<main>\n{body}\n</main>\n"
        f"{scripts}</body>\n</html>\n"
    )


def example_tabs(names: Sequence[str]) -> str:
    """HTML buttons, one for each row of views."""
    return "".join(
        f'<button type="button" data-example="{k}">{html.escape(name)}</button>' for k, name in enumerate(names)
    )


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """HTML table; heads and cells are HTML."""
    head = "".join(f'<th scope="col">{h}</th>' for h in heads)
    body = "\n".join(
        f'<tr><th scope="row">{first}</th>{"".join(f"<td>{cell}</td>" for cell in rest)}</tr>' for first, *rest in rows
    )
    return f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>'


def text_table(shown: TextTable, colours: Mapping[str, str] | None = None, *, words: bool = False) -> str:
    """HTML section of a table of plain text, with its title and note. On a narrow screen each row is a list.

    Args:
        shown: the table.
        colours: colours of the rows by label.
        words: the cells are words, which are aligned to the left; otherwise they are numbers.
    """
    heads = [html.escape(head) for head in shown.heads]
    rows = []
    for i, (label, *cells) in enumerate(shown.cells):
        colour = (colours or {}).get(label)
        mark = "" if colour is None else f'<i class="mark" style="background: {colour}"></i>'
        row = "".join(
            f'<td data-head="{heads[k]}">{_cell(cell, (i, k) in shown.bold)}</td>' for k, cell in enumerate(cells, 1)
        )
        rows.append(f'<tr><th scope="row">{mark}{_cell(label, (i, 0) in shown.bold)}</th>{row}</tr>')
    head = "".join(f'<th scope="col">{h}</th>' for h in heads)
    body = "\n".join(rows)
    kind = "lists words" if words else "lists"
    return (
        f"<section><h2>{html.escape(shown.title)}</h2>"
        f'<table class="{kind}"><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table>'
        f'<p class="note">{html.escape(shown.note)}</p></section>'
    )


def _cell(cell: str, bold: bool) -> str:
    first, *more = html.escape(cell).split("\n")
    return "<br>".join([f"<strong>{first}</strong>" if bold else first, *more])


def _json(data: Any) -> str:
    """JSON without `<`, so that no HTML parser finds `</script>` or `<!--` in it."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")


def _asset(name: str) -> str:
    return files("pcsr.report.web").joinpath(name).read_text(encoding="utf-8")
