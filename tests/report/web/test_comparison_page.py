"""Several runs on one page."""

import base64
import re

import pytest

from pcsr import report
from pcsr.report.tables.comparison_tables import paper_tables
from pcsr.report.tables.markup import comma_separated, latex, markdown
from pcsr.results import parse_results
from pcsr.run_files import FinishedRun


@pytest.fixture
def write(tmp_path):
    """Write the page of runs without examples, of which there are no figures; the page's text."""

    def write(made):
        runs = [FinishedRun(tmp_path / one["name"], parse_results(one), [], None) for one in made]
        compared = report.comparison([run.results for run in runs], "study")
        page = report.write_comparison(compared, runs, tmp_path)
        assert page == tmp_path / "study.html"
        return page.read_text(encoding="utf-8")

    return write


def test_names_are_no_markup(results, variant, write):
    text = write([variant(results, "study-[red]a", model=1), variant(results, "study-<b>b", model=2)])
    assert "<script" not in text, "nothing is drawn"
    assert "<b>b" not in text
    assert "&lt;b&gt;b" in text
    assert "6/6 wins" not in text
    assert "0/6 wins" in text
    assert "http" not in re.sub(r"base64,[^\"]+", "", text), "nothing is fetched"


def test_the_page_says_how_the_runs_differ_and_where_their_reports_are(results, variant, write):
    runs = [variant(results, "study-a", train={"epochs": 1}), variant(results, "study-b", train={"epochs": 7})]
    text = write(runs)
    assert '<td data-head="train">epochs 1</td>' in text
    assert '<td data-head="train">epochs 7</td>' in text
    assert "points 64" not in text
    assert 'href="study-a/report.html"' in text


def test_runs_that_differ_in_nothing_have_no_table_of_differences(results, variant, write):
    assert "What differs" not in write([variant(results, "study-a"), variant(results, "study-b")])


def test_seeds_share_a_row_and_what_differs_is_grouped_by_section(results, variant, write):
    runs = [
        variant(results, f"study-{name}-seed.{seed}", seed=seed, model={"fusion": {"use": name, "heads": 2}})
        for name in ("a", "b")
        for seed in (0, 1)
    ]
    runs[2]["recipe"]["train"]["epochs"] = runs[3]["recipe"]["train"]["epochs"] = 20
    text = write(runs)
    (different,) = re.findall(r"<h2>What differs</h2>(.*?)</section>", text, re.DOTALL)
    assert re.findall(r'<th scope="col">(.*?)</th>', different) == ["", "train", "model"]
    rows = re.findall(r'<tr><th scope="row">.*?</i>(.*?)</th>(.*?)</tr>', different)
    assert [(label, re.findall(r"<td[^>]*>(.*?)</td>", cells)) for label, cells in rows] == [
        ("a", ["epochs 10", "fusion a"]), ("b", ["epochs 20", "fusion b"]),
    ]  # fmt: skip


def test_each_method_has_one_colour_and_each_cell_its_head(results, variant, write):
    text = write([variant(results, "study-a", model=1), variant(results, "study-b", model=2, factor=0.5)])
    colours = {}
    for colour, label in re.findall(r'<i class="mark" style="background: (#\w+)"></i>(.*?)</th>', text):
        colours.setdefault(label, set()).add(colour)
    for label, marks in re.findall(r'<div class="line" title="[^"]*"><span>(.*?)</span><div>(.*?)</div>', text):
        colours[label] |= set(re.findall(r"background: (#\w+)", marks))
    assert colours.keys() == {"a", "b", "midpoint", "a &lt;b&gt;&amp;"}
    assert all(len(of_label) == 1 for of_label in colours.values())
    assert len(set.union(*colours.values())) == 4
    assert '<td data-head="cd ×10³">' in text


def test_the_chart_has_each_interval_at_its_place(results, variant, write):
    runs = [variant(results, "study-a", model=1), variant(results, "study-b", model=2, factor=0.5)]
    for run in runs:
        run["methods"] = run["methods"][:1]
    runs.append(variant(runs[0], "study-c", model=3, factor=1.3))
    text = write(runs)
    (panel,) = re.findall(r"<h3>hd ×10³</h3>(.*?)</div></div></div>", text)
    compared = report.comparison([parse_results(one) for one in runs], "study")
    differences = [one for one in compared.differences["hd"] if one is not None]
    ends = [0.0, *(end for one in differences for end in one.interval)]
    low, high = min(ends), max(ends)

    def at(value):
        return pytest.approx(4 + 92 * (value - low) / (high - low), abs=0.02)

    assert [float(zero) for zero in re.findall(r'class="zero" style="left: ([\d.]+)%', panel)] == 2 * [at(0.0)]
    assert "beyond" not in text.partition("<main>")[2]
    dots = [float(dot) for dot in re.findall(r'class="dot" style="left: ([\d.]+)%', panel)]
    assert dots == [at(one.mean) for one in differences]
    bars = re.findall(r'class="bar" style="left: ([\d.]+)%; right: calc\(100% - ([\d.]+)%\)', panel)
    assert [tuple(map(float, bar)) for bar in bars] == [tuple(map(at, one.interval)) for one in differences]


def test_a_baseline_beyond_the_scale_of_the_networks_is_an_arrow(results, variant, write):
    values = results["methods"][0]["values"]["cd"]
    results["methods"] = [{**results["methods"][k], "values": {**results["methods"][k]["values"]}} for k in (0, 1, 2)]
    results["methods"][1]["values"]["cd"] = [20 * value for value in values]
    results["methods"][2]["values"]["cd"] = [0.9 * value for value in values]
    text = write([variant(results, "study-a", model=1), variant(results, "study-b", model=2, factor=0.8)])
    (panel,) = re.findall(r"<h3>cd ×10³</h3>(.*?)</div></div></div>", text)
    network, far, near, ticks = panel.split('<div class="line')[1:]
    assert "beyond" not in network + near
    assert 'class="dot"' not in far
    assert 'class="bar"' not in far
    assert re.search(r'class="beyond" style="right: 0; color: #\w+">▶', far)
    assert float(re.search(r'class="bar" style="left: ([\d.]+)%', network)[1]) == pytest.approx(4, abs=0.02)
    assert 'style="left: 0; transform: none"' in ticks, "an end's number does not leave the box"


def test_the_tables_can_be_taken_from_the_page(results, variant, write):
    runs = [variant(results, "study-a", model=1), variant(results, "study-b", model=2)]
    text = write(runs)
    files = dict(re.findall(r'<a download="(.*?)" href="data:[^,]*;base64,(.*?)">', text))
    assert files.keys() == {"study.csv", "study.tex", "study.md"}
    compared = report.comparison([parse_results(one) for one in runs], "study")
    decoded = {name: base64.b64decode(content).decode() for name, content in files.items()}
    assert decoded["study.csv"] == comma_separated(compared)
    assert decoded["study.tex"] == latex(paper_tables(compared), "study")
    assert decoded["study.md"] == markdown(report.tables(compared))


def test_a_single_run_without_baselines_has_no_chart(results, variant, write):
    alone = variant(results, "study-a", model=1)
    alone["methods"] = alone["methods"][:1]
    text = write([alone])
    assert 'id="chart"' not in text
    assert "Differences from" not in text
