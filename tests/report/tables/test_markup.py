"""Tables as LaTeX, Markdown and CSV hold the numbers of the comparison."""

import csv
import io
import re
import shutil
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr import report
from pcsr.report.tables.comparison_tables import paper_tables
from pcsr.report.tables.markup import COLUMNS, comma_separated, latex, markdown
from pcsr.report.tables.text_table import TextTable
from pcsr.results import parse_results


@pytest.fixture
def compared(results, variant):
    runs = [variant(results, "s-a_b", model=1, published={"cd": 0.5}), variant(results, "s-c", model=2, factor=2.0)]
    for one in runs:  # a clear best
        one["methods"] = one["methods"][:1]
    return report.comparison([parse_results(one) for one in runs], "s")


def test_latex_has_the_cells_escaped_and_the_best_bold(compared):
    text = latex(report.tables(compared), "study")
    (row,) = re.findall(r"^a\\_b & (.*) \\\\ \\addlinespace$", text, re.MULTILINE)
    mean = f"{compared.rows[0].mean('cd'):.3f}"
    assert row.startswith(rf"\begin{{tabular}}[t]{{@{{}}r@{{}}}}\textbf{{{mean} $\pm$ ")
    assert r"\\ published 0.5\end{tabular}" in row
    assert r"cd $\times$10$^{3}$" in text
    assert r"mean squared distance, a $<$ b \& c" in text
    assert re.findall(r"\\label\{(.*)\}", text) == ["tab:study", "tab:study-2"]
    assert text.count(r"\toprule") == text.count(r"\midrule") == text.count(r"\bottomrule") == 2


def test_tables_of_a_paper_have_captions_and_no_costs_that_were_not_published(results, variant):
    made = [variant(results, "s-a", model=1), variant(results, "s-b", model=2)]
    first, second = paper_tables(report.comparison([parse_results(one) for one in made], "s"))
    assert first.heads == ["", "cd ×10³", "hd ×10³"]
    assert first.title == "Errors on 6 test objects; lower is better"
    assert second.title == "Differences from a"
    assert "\n[" in second.cells[0][1]
    made[1]["recipe"]["evaluate"]["published"] = {"s/epoch": 2.0}
    whole = report.comparison([parse_results(one) for one in made], "s")
    first, _ = paper_tables(whole)
    assert first.heads == ["", "cd ×10³", "hd ×10³", "s/epoch"]
    assert first.cells[1][3].endswith("published 2")
    text = latex(paper_tables(whole), "s")
    captions = re.findall(r"\\caption\{(.*)\}", text)
    assert captions == ["Errors on 6 test objects; lower is better.", "Differences from a."]
    assert "sample standard deviation" in text.partition(r"\end{tabular}")[2], "the note is below the table"


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
@pytest.mark.parametrize("columns", ["onecolumn", "twocolumn"])
def test_tables_fit_the_column_of_an_article(columns, results, variant, tmp_path):
    names = ["s-[a]", "s-*b", "s-" + "long-name-" * 5]
    for k in range(3):
        results["metrics"][f"m{k}"] = results["metrics"]["cd"]
        for method in results["methods"]:
            method["values"][f"m{k}"] = method["values"]["cd"]
    made = [parse_results(variant(results, name, model=name)) for name in names]
    source = latex(paper_tables(report.comparison(made, "s")), "s")
    head = rf"\documentclass[{columns}]{{article}}\usepackage{{booktabs,graphicx}}\begin{{document}}"
    (tmp_path / "a.tex").write_text(f"{head}\n{source}\n\\end{{document}}\n", encoding="utf-8")
    subprocess.run(["pdflatex", "-halt-on-error", "a.tex"], cwd=tmp_path, check=True, stdout=subprocess.DEVNULL)
    log = (tmp_path / "a.log").read_text(encoding="latin-1")
    assert "Output written on a.pdf" in log
    assert not re.findall(r"Overfull \\hbox \(\d\d.*", log)


@given(st.lists(st.lists(st.text("ab1.\\&%$#_{}~^<>|±×†–+-³⁻\n", max_size=9), min_size=2, max_size=2), min_size=1))
def test_latex_of_any_text_is_balanced_and_each_row_has_its_cells(cells):
    table = TextTable("t{", ["", "h_1"], cells, "n%")
    text = latex([table], "x")
    plain = re.sub(r"\\[&%$#_{}]|\\textbackslash\{\}|\\text\w+\{\}", "", text)
    assert plain.count("{") == plain.count("}")
    assert plain.count("$") % 2 == 0
    assert plain.count(r"\begin{") == plain.count(r"\end{")
    body = plain.partition("\\midrule\n")[2].partition("\\bottomrule")[0]
    assert [line.count("&") for line in body.splitlines()] == [1] * len(cells)
    assert "%" not in plain.partition("\n")[2]


def test_markdown_has_the_cells_and_the_best_bold(compared):
    text = markdown(report.tables(compared))
    table = report.tables(compared)[0]
    first = table.cells[0][1].splitlines()[0]
    assert rf"| a\_b | **{first}**<br>published 0.5 |" in text
    lines = [line for line in text.splitlines() if line.startswith("|")]
    assert {line.count(" | ") for line in lines[:4]} == {len(table.heads) - 1}


def test_csv_has_unrounded_numbers(compared):
    lines = list(csv.DictReader(io.StringIO(comma_separated(compared))))
    assert tuple(lines[0]) == COLUMNS
    assert [(line["row"], line["metric"]) for line in lines] == [
        (row.label, metric) for row in compared.rows for metric in compared.metrics
    ]
    by_key = {(line["row"], line["metric"]): line for line in lines}
    first, second = by_key["a_b", "cd"], by_key["c", "cd"]
    difference = compared.differences["cd"][1]
    assert float(first["mean"]) == compared.rows[0].mean("cd")
    assert (first["best"], first["difference"], first["published"]) == ("True", "", "0.5")
    assert (float(second["difference"]), float(second["p_holm"])) == (difference.mean, difference.p_value)
    assert (float(second["ci_low"]), float(second["ci_high"])) == difference.interval
    assert (second["compared_with"], second["wins"], second["best"], second["seeds"]) == ("a_b", "0", "False", "0")


def test_csv_has_seeds_touch_and_no_spread_that_is_none(results, touch, variant):
    runs = [variant(results, f"s-{name}-seed.{k}", seed=k, model=name, factor=factor + 0.1 * k)
            for name, factor in (("a", 1.0), ("b", 0.5)) for k in range(2)]  # fmt: skip
    for run in runs[2:]:
        run["touch"]["exchanged"] = [5.7e-4] * len(run["objects"])
    made = report.comparison([parse_results(one) for one in runs], "s")
    lines = list(csv.DictReader(io.StringIO(comma_separated(made))))
    by_row = {line["row"]: line for line in lines if line["metric"] == "cd"}
    assert float(by_row["b"]["exchanged_touch_efficiency"]) == pytest.approx(0.1)
    assert not by_row["a"]["exchanged_touch_efficiency"]
    assert (by_row["b"]["seeds_better"], by_row["a"]["seeds_better"]) == ("2", "")
    assert float(by_row["b"]["touch_efficiency"]) == pytest.approx(1 / 3)
    assert (by_row["b"]["sd_over"], by_row["b"]["multiplied_by"]) == ("seeds", "1000")
    midpoint = by_row["midpoint"]
    empty = ("sd", "sd_over", "seeds_better", "touch_efficiency", "parameters")
    assert not any(midpoint[key] for key in empty)


def test_every_column_of_the_csv_is_documented():
    text = (Path(__file__).parents[3] / "docs" / "comparing.md").read_text(encoding="utf-8")
    table = text.partition("## The CSV file")[2].partition("\n## ")[0]
    heads = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    assert re.findall(r"`(\w+)`", "".join(heads)) == list(COLUMNS)


def test_files_are_written_in_each_format(compared, tmp_path):
    for form, beginning in (("latex", "% \\usepackage"), ("markdown", "**s**"), ("csv", "row,seeds")):
        report.write_tables(compared, form, tmp_path / form)
        assert (tmp_path / form).read_text(encoding="utf-8").startswith(beginning)
