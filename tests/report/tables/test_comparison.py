"""Numbers of a comparison, against the runs that they are computed from."""

import numpy as np
import pytest

from pcsr.report.tables.comparison import comparison
from pcsr.report.tables.significance import interval, pairwise
from pcsr.results import parse_results


@pytest.fixture
def compared(results, variant):
    """Two recipes of three seeds; the results of `b` are those of `a` with another factor for each seed."""

    def make(factors, **more):
        runs = [variant(results, f"s-a-seed.{seed}", seed=seed, model=1) for seed in range(3)]
        runs += [
            variant(results, f"s-b-seed.{seed}", seed=seed, model=2, factor=factor)
            for seed, factor in enumerate(factors)
        ]
        return comparison([parse_results(one | more) for one in runs], "s")

    return make


def test_differences_are_of_the_means_over_seeds(compared, results):
    made = compared((0.5, 1.5, 0.7))
    values = 1000 * np.array(results["methods"][0]["values"]["cd"])
    each = values * (0.5 + 1.5 + 0.7) / 3 - values
    first, difference = made.differences["cd"][:2]
    assert first is None
    assert difference.mean == pytest.approx(each.mean())
    assert difference.mean == pytest.approx(made.rows[1].mean("cd") - made.rows[0].mean("cd"))
    assert difference.interval == pytest.approx(interval(each))
    assert (difference.wins, difference.better_seeds) == (6, 2)
    rows = np.stack([row.of_objects("cd") for row in made.rows])
    assert difference.p_value == pytest.approx(pairwise(rows)[0, 1])
    assert made.tested == 4


def test_the_first_row_exchanged_negates_the_difference(results, variant):
    runs = [parse_results(variant(results, f"s-{name}", model=name, factor=f)) for name, f in (("a", 1.0), ("b", 1.3))]
    one, other = (comparison(order, "s").differences["hd"][1] for order in (runs, runs[::-1]))
    assert other.mean == pytest.approx(-one.mean)
    assert other.interval == pytest.approx((-one.interval[1], -one.interval[0]))
    assert other.p_value == one.p_value


@pytest.mark.parametrize("order", [(5, 4, 3, 2, 1, 0), (2, 0, 1, 5, 3, 4)])
def test_the_order_of_the_objects_does_not_count(results, variant, order):
    def permuted(made):
        for method in made["methods"]:
            method["values"] = {metric: [values[k] for k in order] for metric, values in method["values"].items()}
        return made | {key: [made[key][k] for k in order] for key in ("objects", "groups")}

    runs = [variant(results, "s-a", model=1), variant(results, "s-b", model=2, factor=1.2)]
    before = comparison([parse_results(one) for one in runs], "s")
    after = comparison([parse_results(permuted(one)) for one in runs], "s")
    for metric, differences in before.differences.items():
        for one, other in zip(differences[1:], after.differences[metric][1:], strict=True):
            assert other.mean == pytest.approx(one.mean)
            assert other.interval == pytest.approx(one.interval)
            assert (other.p_value, other.wins) == (one.p_value, one.wins)


def test_the_floor_is_not_tested_and_never_the_best(results, variant):
    runs = [variant(results, "s-a", model=1), variant(results, "s-b", model=2, factor=2.0)]
    for one in runs:
        one["methods"].append({**one["methods"][1], "name": "floor", "values": {"cd": [1e-9] * 6, "hd": [1e-9] * 6}})
        one["methods"] = [one["methods"][0], one["methods"][-1]]
    made = comparison([parse_results(one) for one in runs], "s")
    assert made.tested == 2
    floor = made.differences["cd"][2]
    assert (floor.p_value, floor.wins) == (None, 6)
    assert made.best == {"cd": 0, "hd": 0}, "6 objects of one sign have p = 1/32"
