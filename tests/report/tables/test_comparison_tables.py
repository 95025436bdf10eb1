"""Several runs in one table."""

import io

import numpy as np
import pytest
from rich.console import Console

from pcsr import report
from pcsr.errors import UserError
from pcsr.report.tables.comparison_tables import p_text
from pcsr.report.tables.rows import variants
from pcsr.report.tables.significance import interval, pairwise
from pcsr.results import parse_results


def compare(runs, name):
    return report.tables(report.comparison([parse_results(one) for one in runs], name))


def printed(comparison):
    console = Console(file=io.StringIO(), width=200)
    console.print(comparison)
    return console.file.getvalue()


def line(comparison, label):
    (found,) = [cells for cells in comparison.cells if cells[0] == label]
    return dict(zip(comparison.heads, found, strict=True))


def test_each_recipe_is_a_row_and_each_baseline_is_there_once(results, variant):
    made, _ = compare([variant(results, "study-a", model=1), variant(results, "study-b", model=2, factor=0.5)], "study")
    assert [cells[0] for cells in made.cells] == ["a", "b", "midpoint", "a <b>&"]
    values = 1000 * np.array(results["methods"][0]["values"]["cd"])
    assert line(made, "a")["cd ×10³"] == f"{values.mean():.3f} ± {values.std(ddof=1):.3f}"
    assert line(made, "b")["cd ×10³"] == f"{values.mean() / 2:.3f} ± {values.std(ddof=1) / 2:.3f}"
    assert line(made, "b")["s/epoch"] == "360"
    assert line(made, "midpoint")["s/epoch"] == ""
    assert line(made, "midpoint")["parameters"] == ""
    assert "6 objects, test split of cad-parts; 64 points to 256" in made.note
    assert "over the objects" in made.note


def test_a_baseline_on_other_clouds_is_another_row(results, variant):
    other = variant(results, "study-b", model=2)
    other["methods"][1]["values"]["cd"][0] *= 2
    made, *_ = compare([variant(results, "study-a", model=1), other], "study")
    assert [cells[0] for cells in made.cells].count("midpoint") == 2


def test_runs_that_differ_in_their_seed_alone_are_one_row(results, variant):
    runs = [variant(results, f"study-a-seed.{seed}", seed=seed, factor=1 + seed) for seed in range(3)]
    runs.append(variant(results, "study-b", model=2))
    made, *_ = compare(runs, "study")
    assert "±" not in line(made, "b")["cd ×10³"], "one seed has no deviation over seeds"
    means = 1000 * np.mean(results["methods"][0]["values"]["cd"]) * np.array([1, 2, 3])
    assert line(made, "a")["cd ×10³"] == f"{means.mean():.3f} ± {means.std(ddof=1):.3f}"
    assert "over the means of 3 seeds (0, 1, 2)" in made.note
    row, _ = variants([parse_results(one) for one in runs], "study")
    assert row.values["cd"].shape == (3, 6)


def test_what_was_published_stands_beside_it(results, variant):
    made, *_ = compare(
        [variant(results, "a", published={"cd": 0.671, "s/cloud": 0.0241}), variant(results, "b", model=2)], "study"
    )
    assert line(made, "a")["cd ×10³"].endswith("\npublished 0.671")
    assert line(made, "a")["s/cloud"].endswith("\npublished 0.0241")
    assert "published" not in line(made, "a")["hd ×10³"]


@pytest.mark.parametrize("axis", ["touches", "rate"])
def test_touches_and_rates_become_columns(results, axis, variant):
    runs = [
        variant(results, f"study-{name}-{axis}.{k}", factor=1 + k, model=name, data=k, published={"cd": float(k)})
        for name in ("x", "y")
        for k in (0, 2)
    ]
    whole, _, pivot = compare(runs[:3], "study")
    assert len(whole.cells) == 5
    assert pivot.heads == [axis, "0", "2"]
    mean = 1000 * np.mean(results["methods"][0]["values"]["cd"])
    assert pivot.cells == [
        ["x", f"{mean:.3f}\npublished 0", f"{3 * mean:.3f}\npublished 2"],
        ["y", f"{mean:.3f}\npublished 0", ""],
    ]


def test_names_are_no_markup_on_screen(results, variant):
    runs = [variant(results, "study-[red]a", model=1), variant(results, "study-<b>b", model=2)]
    assert "[red]a" in printed(compare(runs, "study")[0])


def test_malformed_results_are_named(results, variant):
    broken = variant(results, "a")
    del broken["methods"][0]["seconds"]
    with pytest.raises(UserError, match=r"methods\.0\.seconds"):
        compare([broken], "study")


def test_rows_of_other_clouds_are_not_counted_against_each_other(results, variant):
    other = variant(results, "study-b", model=2, factor=0.5)
    other["data"] |= {"truth": 512, "rate": 8}
    whole, differences = compare([variant(results, "study-a", model=1), other], "study")
    assert [cells[0] for cells in differences.cells] == ["midpoint 4×", "a <b>& 4×"]
    assert not whole.bold, "the best is among rows of the same clouds"
    assert {cells[0] for cells in whole.cells} >= {"midpoint 4×"}
    assert "64 points to 256 or 64 points to 512" in whole.note


def test_the_note_names_the_protocol_of_each_row(results, variant):
    runs = [variant(results, f"study-{name}", model=name) for name in "abcd"]
    for run, protocol in zip(runs, ("as x", "as y", "as x"), strict=False):
        run["protocol"] = protocol
    note = compare(runs, "study")[0].note
    assert note.endswith(". a, c: as x. b: as y.")
    assert note.count("as x") == 1
    assert "midpoint:" not in note


def test_labels_leave_out_what_all_begin_with(results, variant):
    runs = [variant(results, f"small-fusion.{name}", model=name) for name in ("my.one", "my.other")]
    made, *_ = compare(runs, "compare")
    assert [cells[0] for cells in made.cells][:2] == ["fusion.my.one", "fusion.my.other"]


@pytest.mark.parametrize(
    ("names", "labels"),
    [
        (["small-fusion.pu-net", "small-fusion.pu-gan"], ["fusion.pu-net", "fusion.pu-gan"]),
        (["small-rate.2-fusion.pu-a", "small-rate.2-fusion.pu-b"], ["fusion.pu-a", "fusion.pu-b"]),
        (["small-fusion.pu-a-rate.2", "small-fusion.pu-a-rate.4"], ["rate.2", "rate.4"]),
        (["small-fusion.pu-a", "small-fusion.pu-a-b"], ["fusion.pu-a", "fusion.pu-a-b"]),
    ],
)
def test_labels_have_whole_values(results, variant, names, labels):
    made, *_ = compare([variant(results, name, model=name) for name in names], "compare")
    assert [cells[0] for cells in made.cells][:2] == labels


def test_names_are_whole_on_a_narrow_screen(results, variant):
    names = [f"a-{'long' * 6}-name-{number}" for number in range(2)]
    made, *_ = compare([variant(results, name, model=name) for name in names], "study")
    console = Console(file=io.StringIO(), width=80)
    console.print(made)
    text = console.file.getvalue()
    assert all(cells[0] in text for cells in made.cells[:2])


def test_touch_efficiencies_are_spread_over_seeds_and_a_network_without_touch_has_a_dash(results, touch, variant):
    runs = [variant(results, f"study-a-seed.{seed}", seed=seed) for seed in range(2)]
    runs[1]["touch"]["touched"] = [4.5e-4] * 6  # a half instead of a third
    runs.append(variant(results, "study-b", model=2))
    runs[2] |= {"touch": None, "data": {**runs[2]["data"], "touches": 0}}
    made, *_ = compare(runs, "study")
    assert (
        line(made, "a")["touch efficiency"] == f"{np.mean([1 / 3, 1 / 2]):.3f} ± {np.std([1 / 3, 1 / 2], ddof=1):.3f}"
    )
    assert line(made, "b")["touch efficiency"] == "–"
    assert line(made, "midpoint")["touch efficiency"] == ""
    assert "(without - with)" in made.note
    assert "another object" not in made.note
    runs[0]["touch"]["exchanged"] = [6e-4] * 6
    of_others, *_ = compare(runs, "study")
    assert line(of_others, "a")["touch efficiency"].endswith("\nanother object's 0.000")
    assert "Another object's: the same" in of_others.note
    alone, *_ = compare(runs[2:], "study")
    assert "touch efficiency" not in alone.heads
    assert "(without - with)" not in alone.note


def test_the_floor_decides_no_digits(results, variant):
    runs = [variant(results, "study-a", model=1), variant(results, "study-b", model=2)]
    before = line(compare(runs, "study")[0], "a")
    for one in runs:
        one["methods"].append({**one["methods"][1], "name": "floor", "values": {"cd": [1e-9] * 6, "hd": [1e-9] * 6}})
    made, *_ = compare(runs, "study")
    assert line(made, "a") == before
    assert line(made, "floor")["cd ×10³"].startswith("0.000 ± 0.000")


def test_differences_are_paired_with_the_first_row(results, variant):
    runs = [variant(results, "study-a", model=1), variant(results, "study-b", model=2, factor=0.5)]
    _, made = compare(runs, "study")
    assert made.title == "Differences from a"
    assert [cells[0] for cells in made.cells] == ["b", "midpoint", "a <b>&"]
    each = -0.5 * 1000 * np.array(results["methods"][0]["values"]["cd"])
    low, high = interval(each)
    text, p_value, wins = line(made, "b")["cd ×10³"].splitlines()
    assert text == f"{each.mean():+.4f} [{low:+.4f}, {high:+.4f}]", "a digit more than the means"
    rows = [one["methods"][0]["values"]["cd"] for one in runs] + [m["values"]["cd"] for m in results["methods"][1:]]
    assert (p_value, wins) == (p_text(pairwise(np.array(rows))[0, 1]), "6/6 wins")
    assert "all pairs of 4 rows" in made.note
    assert "6 objects are too few for any significant difference between 4 rows" in made.note


def test_with_seeds_it_says_with_how_many_a_row_is_better(results, variant):
    runs = [variant(results, f"study-a-seed.{seed}", seed=seed, model=1) for seed in range(3)]
    factors = (0.5, 2.5, 0.5)
    runs += [variant(results, f"study-b-seed.{k}", seed=k, model=2, factor=factors[k]) for k in range(3)]
    _, made = compare(runs, "study")
    assert line(made, "b")["cd ×10³"].endswith("0/6 wins, 2/3 seeds")
    assert "seeds" not in line(made, "midpoint")["cd ×10³"]


def test_the_weights_that_early_stopping_kept_are_named_by_row(results, variant):
    runs = [variant(results, f"study-a-seed.{seed}", seed=seed, model=1) for seed in range(3)]
    runs.append(variant(results, "study-b-seed.0", seed=0, model=2))
    for run, best in zip(runs[:3], (16, 24, 16), strict=True):
        run["training"] = {**run["training"], "steps": 96, "best_step": best}
    note = compare(runs, "study")[0].note
    assert "Early stopping: a weights of step 16 of 96, 24 of 96. " in note


def test_a_row_with_fewer_seeds_and_runs_that_are_left_out_are_named(results, variant):
    runs = [variant(results, f"study-a-seed.{seed}", seed=seed, model=1) for seed in range(2)]
    runs.append(variant(results, "study-b-seed.1", seed=1, model=2))
    compared = report.comparison([parse_results(one) for one in runs], "study", ["study-b-seed.0 failed: nan"])
    note = report.tables(compared)[0].note
    assert "Fewer seeds: b 1." in note
    assert "Left out: study-b-seed.0 failed: nan." in note


def test_only_metrics_that_all_runs_have_are_compared(results, variant):
    fewer = variant(results, "study-b", model=2)
    del fewer["metrics"]["hd"]
    made, _ = compare([variant(results, "study-a", model=1), fewer], "study")
    assert [head for head in made.heads if "×" in head] == ["cd ×10³"]
    fewer["metrics"] = {"other": fewer["metrics"]["cd"]}
    fewer["methods"] = [{**method, "values": {"other": method["values"]["cd"]}} for method in fewer["methods"]]
    with pytest.raises(UserError, match=r"no metric in common \(study-a: cd, hd; study-b: other\)"):
        compare([variant(results, "study-a", model=1), fewer], "study")


@pytest.mark.parametrize(
    ("p_value", "text"),
    [(1.0, "p = 1.00"), (0.2, "p = 0.20"), (0.0123, "p = 0.012"), (0.001, "p = 0.001"), (9e-4, "p < 0.001")],
)
def test_p_values_have_two_digits(p_value, text):
    assert p_text(p_value) == text
