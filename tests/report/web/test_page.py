import json
import statistics
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from ruamel.yaml import YAML

from pcsr import report
from pcsr.errors import UserError
from pcsr.report.web.page import render
from pcsr.results import parse_results
from pcsr.run_files import read_run

VOID = {"meta", "br"}


class Page(HTMLParser):
    """The texts of a page by element, and every attribute; fails where tags don't nest."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.found, self.attributes = [], [], []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        self.attributes += [(tag, name, value) for name, value in attrs]
        if tag not in VOID:
            entry = [tag, dict(attrs), ""]
            self.found.append(entry)
            self.open.append(entry)

    def handle_endtag(self, tag):
        assert self.open.pop()[0] == tag

    def handle_data(self, data):
        for entry in self.open:
            entry[2] += data

    def texts(self, tag, **attributes):
        return [text for t, a, text in self.found if t == tag and attributes.items() <= a.items()]


@pytest.fixture
def draw(run, results, history):
    """The page of the results as they are when called, with a stand-in for plotly.js."""

    def draw(history=history, examples=True):
        read = replace(read_run(run), results=parse_results(results), history=history)
        shown = read if examples else replace(read, examples=[])
        return Page(render(shown, plotly="const Plotly = {};"))

    return draw


def drawn(page):
    return json.loads(page.texts("script", id="drawn")[0])


def test_the_table_shows_what_the_results_hold(draw, results):
    page = draw()
    (body,) = page.texts("section", id="metrics")
    for method in results["methods"]:
        assert method["name"] in page.texts("th", scope="row")
        for values, decimals in ((method["values"]["cd"], 3), (method["values"]["hd"], 1)):
            mean, spread = 1000 * statistics.mean(values), 1000 * statistics.stdev(values)
            assert f"{mean:.{decimals}f} ± {spread:.{decimals}f}" in body
    assert not page.texts("strong", title="significantly the best"), "6 objects and 3 methods are too few"
    ours, theirs = (m["values"]["hd"] for m in results["methods"][:2])
    assert page.texts("small")[1] == f"{sum(a < b for a, b in zip(ours, theirs, strict=True))}/6 wins"
    assert len(page.texts("small")) == 4  # the baseline has none


def test_a_clear_best_is_bold(draw, results):
    for k, method in enumerate(results["methods"]):
        method["values"] = {"cd": [k + 0.1 * i for i in range(1, 13)], "hd": [0.1 * i for i in range(12)]}
    results["objects"], results["groups"] = list("abcdefghijkl"), ["all"] * 12
    (bold,) = draw().texts("strong", title="significantly the best")
    assert bold.startswith("650 ")


def test_the_statement_says_data_protocol_convention_seed_and_spread(draw):
    (text,) = draw().texts("p", **{"class": "lead"})
    for fact in (
        *("6 objects of 60 mm of cad-parts", "split test", "64 points", "2 touches", "7.12 %", "256 points (4×)"),
        *("random", "compared in the unit sphere", "seed 7", "standard deviation", "ab12cd34", "0.1.0"),
    ):
        assert fact in text


def test_vision_only_is_said(draw, results):
    results["data"] |= {"touches": 0, "coverage": 0.0, "object_size": None}
    (text,) = draw().texts("p", **{"class": "lead"})
    assert "no touches become" in text
    assert "6 objects of cad-parts" in text


def test_the_groups_table_shows_every_metric(draw, results):
    page = draw()
    pipes = [v for v, g in zip(results["methods"][1]["values"]["hd"], results["groups"], strict=True) if g == "pipe"]
    assert f"{1000 * statistics.mean(pipes):#.4g}" in page.texts("td")
    assert [t for t, a, _ in page.found if a.get("data-chart") == "groups"] == ["div"]


def test_a_single_group_is_not_compared(draw, results):
    results["groups"] = ["gear"] * 6
    page = draw()
    assert page.texts("section", id="by-group") == []
    assert "groups" not in drawn(page)["charts"]


def test_examples_are_chosen_by_their_names(draw, results):
    page = draw()
    assert page.texts("button") == results["objects"][:2]
    examples = drawn(page)["examples"]
    assert [example["name"] for example in examples] == results["objects"][:2]
    assert len(examples[0]["views"]) == 7
    assert draw(examples=False).texts("section", id="examples") == []


def test_each_chart_has_its_place(draw):
    page = draw()
    charts = [a["data-chart"] for _, a, _ in page.found if "data-chart" in a]
    assert sorted(charts) == sorted(drawn(page)["charts"]) == ["groups", "loss", "validation"]


def test_ready_trained_weights_are_said_to_be(draw):
    page = draw(history=None)
    (text,) = page.texts("section", id="training")
    assert "ready-trained" in text
    assert "shipped weights. Training: 10 epochs, 9000 steps, 60.0 minutes, on 1 x cpu." in text
    assert set(drawn(page)["charts"]) == {"groups"}
    assert "ready-trained" not in draw().texts("section", id="training")[0]


@pytest.mark.parametrize(("seconds", "shown"), [(7.25, "7.2 seconds"), (90.0, "90.0 seconds"), (150.0, "2.5 minutes")])
def test_short_trainings_are_told_in_seconds(draw, results, seconds, shown):
    results["training"]["seconds"] = seconds
    assert f", {shown}, " in draw().texts("section", id="training")[0]


def test_the_recipe_reads_back(draw, results):
    (text,) = draw().texts("pre")
    assert YAML(typ="safe").load(text) == results["recipe"]


def test_text_is_text_wherever_it_stands(draw, results):
    """Names with markup nest correctly (Page fails otherwise), run nothing and come out as they went in."""
    evil = "</script><script>alert(1)</script><!--"
    results["name"] = results["data"]["sampling"] = results["training"]["source"] = evil
    results["hardware"] = {evil: evil}
    results["metrics"]["cd"]["description"] = evil
    page = draw()
    assert page.texts("h1") == [evil]
    assert len(page.texts("script")) == 3
    assert evil in page.texts("dd")
    assert evil in page.texts("p", **{"class": "lead"})[0]


def test_the_written_page_is_whole_and_offline(run):
    path = report.write_page(read_run(run))
    assert path == run / "report.html"
    assert {p.name for p in run.iterdir()} == {"results.json", "examples.safetensors", "metrics.jsonl", "report.html"}
    text = path.read_text(encoding="utf-8")
    page = Page(text)
    assert text.startswith("<!doctype html>")
    assert not [a for a in page.attributes if a[1] in ("src", "href", "srcset", "action", "data")]
    data, plotly, script = page.texts("script")
    assert plotly.lstrip().startswith("/**\n* plotly.js")
    rest = script + page.texts("style")[0]
    assert not any(word in rest for word in ("http:", "https:", "//cdn", "url(", "@import"))
    assert json.loads(data)["examples"]


@pytest.mark.parametrize("name", ["results.json", "examples.safetensors"])
def test_a_missing_file_is_named_and_nothing_is_written(run, name):
    (run / name).unlink()
    with pytest.raises(UserError, match=f"{name} is missing; do `pcsr run` again"):
        report.write_page(read_run(run))
    assert not (run / "report.html").exists()


def test_a_page_that_cannot_be_written_leaves_the_old_one(run):
    (run / "report.html").mkdir()
    with pytest.raises(UserError, match=r"report\.html is a folder"):
        report.write_page(read_run(run))
    assert not list(run.glob(".*"))


def test_what_touch_does_has_a_section_where_it_was_measured(draw, results, touch):
    page = draw()
    (text,) = page.texts("section", id="touch")
    assert "with touches: 0.5; without: 0.6; without, but with the touched region replaced by the truth: 0.3" in text
    assert "0.125 seconds" in text
    assert "0.333" in page.texts("td")
    assert "touch efficiency" in page.texts("dt")
    charts = [a["data-chart"] for _, a, _ in page.found if "data-chart" in a]
    assert sorted(charts) == sorted(drawn(page)["charts"]) == ["groups", "loss", "touch", "validation"]
    assert "another object's" not in page.texts("dt")
    touch["exchanged"] = [5.7e-4] * len(results["objects"])
    page = draw()
    assert "another object's" in page.texts("dt")
    assert "with the touches of another object: 0.57" in page.texts("section", id="touch")[0]
    del results["touch"]
    page = draw()
    assert page.texts("section", id="touch") == []
    assert "touch efficiency" not in page.texts("th")


def test_the_statement_names_the_protocol_unless_the_results_are_older(draw, results):
    assert "makes them" not in draw().texts("p")[0]
    results["protocol"] = "by patches & more"
    (lead,) = [text for text in draw().texts("p") if "become 256 points" in text]
    assert "(4×). tapsr makes them by patches & more. Clouds are compared" in lead
