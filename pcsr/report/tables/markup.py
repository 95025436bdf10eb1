"""Tables as text of other programs: LaTeX and Markdown of what the terminal shows, CSV of the unrounded numbers."""

import csv
import io
import re
from collections.abc import Sequence

from pcsr.report.tables.comparison import Comparison
from pcsr.report.tables.text_table import TextTable

_LATEX = (
    {character: rf"\{character}" for character in "&%$#_{}"}
    | {
        "\\": r"\textbackslash{}",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "±": r"$\pm$",
        "×": r"$\times$",
        "†": r"$\dagger$",
        "–": "--",
        "σ": r"$\sigma$",
    }
    | {character: f"${character}$" for character in "<>|"}
)
_FITTED = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}"
_SUPERSCRIPTS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
COLUMNS = (
    *("row", "seeds", "objects", "metric", "multiplied_by", "mean", "sd", "sd_over", "best", "compared_with"),
    *("difference", "ci_low", "ci_high", "p_holm", "wins", "seeds_better", "published", "touch_efficiency"),
    *("exchanged_touch_efficiency", "parameters", "seconds_per_cloud", "seconds_per_epoch"),
)
"""Columns of the CSV file, which docs/comparing.md describes."""


def latex(tables: Sequence[TextTable], label: str) -> str:
    """LaTeX source of tables, each a `table` with caption, label, and its note below. Needs booktabs and graphicx.

    A table that is wider than the column is scaled down to it.

    Args:
        tables: tables of `comparison_tables.paper_tables`.
        label: label of the first table; those of the others end in a number.
    """
    parts = [_latex_table(table, f"tab:{label}" + (f"-{k}" if k > 1 else "")) for k, table in enumerate(tables, 1)]
    return "% \\usepackage{booktabs,graphicx}\n" + "\n".join(parts)


def _latex_table(table: TextTable, label: str) -> str:
    end = r" \\ \addlinespace" if any("\n" in cell for row in table.cells for cell in row) else r" \\"
    lines = [" & ".join(map(_latex_text, table.heads)) + r" \\", r"\midrule"]
    for i, row in enumerate(table.cells):
        lines.append(" & ".join(_latex_cell(cell, (i, k) in table.bold, k) for k, cell in enumerate(row)) + end)
    body = "\n".join(lines)
    return (
        "\\begin{table}\n\\centering\n\\footnotesize\n\\setlength{\\tabcolsep}{4pt}\n"
        f"\\caption{{{_latex_text(table.title)}.}}\n\\label{{{label}}}\n\\smallskip\n"
        f"{_FITTED}{{\\begin{{tabular}}{{l{'r' * (len(table.heads) - 1)}}}\n"
        f"\\toprule\n{body}\n\\bottomrule\n\\end{{tabular}}}}\n\n\\smallskip\n"
        f"\\parbox{{\\linewidth}}{{\\scriptsize {_latex_text(table.note)}}}\n\\end{{table}}\n"
    )


def _latex_cell(cell: str, bold: bool, column: int) -> str:
    """LaTeX of a cell; several lines become a tabular of their own."""
    first, *more = map(_latex_text, cell.split("\n"))
    if bold:
        first = rf"\textbf{{{first}}}"
    if not more:
        return first
    lines = r" \\ ".join((first, *more))
    return rf"\begin{{tabular}}[t]{{@{{}}{'r' if column else 'l'}@{{}}}}{lines}\end{{tabular}}"


def _latex_text(text: str) -> str:
    """LaTeX of plain text. Signs of numbers become mathematical ones, and superscript digits powers."""
    text = "".join(_LATEX.get(character, character) for character in text)
    text = re.sub("[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+", lambda found: f"$^{{{found[0].translate(_SUPERSCRIPTS)}}}$", text)
    text = re.sub(r"(?<![\w}.])([-+])(?=\d)", r"$\1$", text)
    return re.sub(r"^[\[*]", r"{\g<0>}", text)  # after the end of a line they would be its option


def markdown(tables: Sequence[TextTable]) -> str:
    """Markdown of tables, each with its title and note."""
    return "\n".join(_markdown_table(table) for table in tables)


def _markdown_table(table: TextTable) -> str:
    rows = [table.heads, ["---", *["---:"] * (len(table.heads) - 1)]]
    lines = [" | ".join(_markdown_text(head) for head in rows[0]), " | ".join(rows[1])]
    for i, row in enumerate(table.cells):
        cells = []
        for k, cell in enumerate(row):
            first, *more = map(_markdown_text, cell.split("\n"))
            cells.append("<br>".join([f"**{first}**" if (i, k) in table.bold else first, *more]))
        lines.append(" | ".join(cells))
    body = "\n".join(f"| {line} |" for line in lines)
    return f"**{_markdown_text(table.title)}**\n\n{body}\n\n{_markdown_text(table.note)}\n"


def _markdown_text(text: str) -> str:
    return re.sub(r"([\\`*_\[\]<>|#~])", r"\\\1", text)


def comma_separated(compared: Comparison) -> str:
    """CSV of a comparison: a line for each row and metric, with unrounded numbers.

    Values are those of the metric times the column `multiplied_by`. A field is empty where there is no such number.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for number, row in enumerate(compared.rows):
        for metric, note in compared.metrics.items():
            difference = compared.differences[metric][number]
            low, high = (None, None) if difference is None or difference.interval is None else difference.interval
            spread = row.spread(metric, over_seeds=compared.over_seeds)
            over = None if spread is None else "seeds" if compared.over_seeds else "objects"
            writer.writerow(
                [
                    *(row.label, " ".join(map(str, row.seeds)), len(row.runs[0].objects), metric, note.scale),
                    *(row.mean(metric), spread, over, compared.best[metric] == number),
                    *(None if difference is None else compared.first.label, difference and difference.mean),
                    *(low, high, difference and difference.p_value, difference and difference.wins),
                    *(difference and difference.better_seeds, row.published.get(metric)),
                    *(_mean(row.efficiencies or ()), _mean(row.exchanged)),
                    *(row.parameters or None, row.seconds, row.epoch),
                ]
            )
    return text.getvalue()


def _mean(values: Sequence[float | None]) -> float | None:
    """Mean of the known values; None if there is none."""
    known = [one for one in values if one is not None]
    return sum(known) / len(known) if known else None
