"""The rows of a comparison: a recipe with its seeds is one row, a baseline is there once."""

import copy

import numpy as np
import pytest

from pcsr.report.tables.rows import MARK, baselines, variants
from pcsr.results import parse_results


@pytest.fixture
def run(results):
    def make(name, *, seed=0, factor=1.0, **recipe):
        made = copy.deepcopy(results) | {"name": name, "seed": seed}
        made["recipe"] |= {"name": name, "seed": seed, "train": {"epochs": 10}, **recipe}
        made["methods"][0]["values"] = {
            metric: [factor * value for value in values] for metric, values in made["methods"][0]["values"].items()
        }
        return parse_results(made)

    return make


def test_runs_that_differ_in_their_seed_alone_share_a_row(run):
    (row,) = variants([run("study-a-seed.0", factor=1.0), run("study-a-seed.1", seed=1, factor=3.0)], "study")
    assert row.label == "a"
    assert row.values["cd"].shape == (2, 6)
    np.testing.assert_allclose(row.values["cd"][1], 3 * row.values["cd"][0])
    assert row.mean("cd") == pytest.approx(2 * row.values["cd"][0].mean())
    means = row.values["cd"].mean(1)
    assert row.spread("cd", over_seeds=True) == pytest.approx(np.std(means, ddof=1))
    assert row.spread("cd", over_seeds=False) == pytest.approx(np.std(row.values["cd"][0], ddof=1))
    assert row.epoch == 360.0


def test_a_single_seed_has_no_spread_over_seeds(run):
    (row,) = variants([run("study-a")], "study")
    assert row.spread("cd", over_seeds=True) is None


def test_labels_leave_out_what_all_begin_with(run):
    rows = variants([run("study-x-rate.2-fusion.a", model=1), run("study-x-rate.2-fusion.b", model=2)], "study")
    assert [row.label for row in rows] == ["fusion.a", "fusion.b"]


def test_labels_keep_a_name_that_is_the_beginning_of_all(run):
    names = ("table2-pu-gcn", "table2-pu-gcn-touch", "table2-pu-gcn-touch-edge-conv")
    rows = variants([run(name, model=name) for name in names], "comparison")
    assert [row.label for row in rows] == list(names)


def test_rows_of_the_same_clouds_are_comparable(run, results):
    one, other = variants([run("s-a", model=1, factor=0.5), run("s-b", model=2)], "s")
    assert one.comparable(other)
    results["data"]["points"] = 32
    (elsewhere,) = variants([run("s-c", model=3)], "s")
    assert not one.comparable(elsewhere)


def test_rows_whose_clouds_change_with_the_seed_are_comparable_seed_by_seed(run, results):
    runs = {"a": [], "b": []}
    for seed in (0, 1):
        results["data"]["radii"] = [0.5 + seed] * 6
        for name, made in runs.items():
            made.append(run(f"s-{name}-seed.{seed}", seed=seed, model=name))
    one, other = variants([*runs["a"], *runs["b"]], "s")
    assert one.comparable(other)
    assert not one.comparable(variants(runs["b"][:1], "s")[0])


def test_one_recipe_and_seed_twice_are_two_rows(run):
    first, second = variants([run("s-a"), run("s-a")], "s")
    assert (first.label, second.label) == ("a", "a (2)")
    assert first.values["cd"].shape == (1, 6)


def test_a_baseline_is_there_once_and_again_where_its_values_differ(run, results):
    first = run("s-a", model=1)
    assert [row.label for row in baselines([first, run("s-b", model=2)])] == ["midpoint", "a <b>&"]
    results["methods"][1]["values"]["cd"][0] *= 2
    assert [row.label for row in baselines([first, run("s-b", model=2)])] == ["midpoint", "a <b>&", "midpoint"]


def test_weights_of_other_code_are_marked(run, results):
    assert variants([run("s-a")], "s")[0].marked == "a"
    results["training"]["other_code"] = "fusion 'mine' has changed"
    (row,) = variants([run("s-a")], "s")
    assert row.marked == f"a {MARK}"
    assert baselines([run("s-a")])[0].other_code is None


def test_what_was_published_is_a_line_of_its_own(run):
    (row,) = variants([run("s-a", evaluate={"published": {"cd": 0.25}})], "s")
    assert (row.published_line("cd"), row.published_line("hd")) == ("\npublished 0.25", "")
