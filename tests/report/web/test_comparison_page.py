"""Several runs on one page."""

import pytest

from pcsr import report
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


def test_the_page_says_how_the_runs_differ_and_where_their_reports_are(results, variant, write):
    runs = [variant(results, "study-a", train={"epochs": 1}), variant(results, "study-b", train={"epochs": 7})]
    text = write(runs)
    assert '<th scope="row">a</th><td>epochs 1</td>' in text
    assert '<th scope="row">b</th><td>epochs 7</td>' in text
    assert "points 64" not in text
    assert 'href="study-a/report.html"' in text


def test_runs_that_differ_in_nothing_have_no_table_of_differences(results, variant, write):
    assert "What differs" not in write([variant(results, "study-a"), variant(results, "study-b")])
