import io
import statistics

import pytest
from rich.console import Console

from pcsr import report
from pcsr.errors import UserError
from pcsr.report.tables.significance import RULE
from pcsr.results import parse_results


def table(results):
    return report.table(parse_results(results))


def printed(results):
    console = Console(file=io.StringIO(), width=160)
    console.print(table(results))
    return console.file.getvalue()


def test_seconds_say_what_they_are(results):
    assert "s/cloud: mean wall time for one cloud." in " ".join(printed(results).split()), "results of 0.1"
    results["timing"], results["hardware"] = "median", {"cores": 2, "threads": 1, "load": 0.5, "torch": "2.6"}
    said = "s/cloud: median wall time for one cloud (cores 2, threads 1, load 0.5, torch 2.6)."
    assert said in " ".join(printed(results).split())
    results["hardware"]["load"] = None  # a system that has none
    assert "(cores 2, threads 1, torch 2.6)" in " ".join(printed(results).split())


def test_the_note_names_the_protocol_unless_the_results_are_older(results):
    assert "as pcsr upsample" not in printed(results)
    results["protocol"] = "as pcsr upsample"
    assert "baseline's; wins" in " ".join(printed(results).split())
    assert " tapsr: as pcsr upsample. s/cloud:" in " ".join(printed(results).split())


def test_a_method_without_a_network_has_no_number_of_parameters(results):
    made = table(results)
    column = made.heads.index("parameters")
    assert [row[column] for row in made.cells] == ["1,234,567", "", ""]


def test_a_single_object_is_in_the_singular(results):
    results["objects"], results["groups"] = results["objects"][:1], results["groups"][:1]
    for method in results["methods"]:
        method["values"] = {metric: values[:1] for metric, values in method["values"].items()}
    assert table(results).note.startswith("1 object of 60 mm, test split")


def test_the_screen_shows_the_numbers(results):
    text = printed(results)
    for metric in results["metrics"]:
        assert f"{metric} ×10³" in text
    for method in results["methods"]:
        line = next(line for line in text.splitlines() if line.strip().startswith(method["name"]) and "±" in line)
        for values, decimals in ((method["values"]["cd"], 3), (method["values"]["hd"], 1)):
            mean, spread = 1000 * statistics.mean(values), 1000 * statistics.stdev(values)
            assert f"{mean:.{decimals}f} ± {spread:.{decimals}f}" in line
        assert f"{method['parameters']:,}" in line
    wins = sum(a < b for a, b in zip(*(m["values"]["cd"] for m in results["methods"][:2]), strict=True))
    assert f"{wins}/6 wins" in text
    assert "better than midpoint" in text


def test_only_a_best_that_is_significantly_better_is_bold(results):
    assert not table(results).bold, "6 objects and 3 methods are too few"
    for k, method in enumerate(results["methods"]):
        method["values"] = {metric: [0.001 * (1 + k) + 1e-5 * i for i in range(12)] for metric in method["values"]}
    results["objects"], results["groups"] = list("abcdefghijkl"), ["all"] * 12
    shown = table(results)
    assert shown.bold == {(0, 1), (0, 2)}
    assert RULE in shown.note
    console = Console(file=io.StringIO(), width=160, force_terminal=True, color_system="standard")
    console.print(shown)
    assert f"\x1b[1m{shown.cells[0][1].splitlines()[0]}\x1b[0m" in console.file.getvalue()


def test_a_network_that_loses_after_a_short_training_has_an_explanation(results):
    results["training"]["steps"] = 8
    for k, values in enumerate(([0.2] * 6, [0.1] * 6)):
        results["methods"][k]["values"]["cd"] = values
    said = report.few_steps(parse_results(results))
    assert said.startswith("tapsr is worse than midpoint in cd: its training had 8 steps")
    results["training"]["steps"] = 9000
    assert report.few_steps(parse_results(results)) is None
    results["training"]["steps"] = 8
    results["methods"][0]["values"]["cd"] = [0.05] * 6
    assert report.few_steps(parse_results(results)) is None


def test_names_are_no_markup(results):
    results["methods"][2]["name"] = "[red]odd[/red]"
    assert "[red]odd[/red]" in printed(results)


def test_malformed_results_are_named(results):
    del results["methods"][0]["seconds"]
    with pytest.raises(UserError, match=r"the results: methods\.0\.seconds"):
        table(results)


def test_the_touch_efficiency_is_the_networks_alone(results, touch):
    shown = table(results)
    columns = dict(zip(shown.heads, zip(*shown.cells, strict=True), strict=True))
    assert columns["touch efficiency"] == ("0.333", "", "")
    assert "(without - with)" in shown.note
    assert "another object" not in shown.note
    touch["exchanged"] = [5.7e-4] * len(results["objects"])
    shown = table(results)
    columns = dict(zip(shown.heads, zip(*shown.cells, strict=True), strict=True))
    assert columns["touch efficiency"] == ("0.333\nanother object's 0.100", "", "")
    assert "Another object's: the same with the touches of another object" in shown.note
    del results["touch"]
    assert "touch" not in "".join(table(results).heads)
    assert "(without - with)" not in table(results).note


def test_the_summary_has_the_scores_of_the_first_method(results):
    shown = table(results)
    cells = [cell.splitlines()[0] for cell in shown.cells[0]]
    scores = ", ".join(f"{head} {cell}" for head, cell in zip(shown.heads, cells, strict=True) if "±" in cell)
    assert "±" in scores
    assert report.summary(parse_results(results)) == f"{shown.cells[0][0]}: {scores}"
