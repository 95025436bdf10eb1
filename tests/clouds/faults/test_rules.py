"""Rules find in parts what is found in the whole cloud."""

import numpy as np
import pytest

from pcsr.clouds.faults import find_faults
from pcsr.clouds.faults.rules import HEALTHY, Rules, Suspicion


def sick():
    """A sheet with points of each kind of fault."""
    points = np.random.default_rng(0).uniform(-1, 1, (3000, 3)) * [1, 1, 0.01] + [5, 5, 5]
    points[10:40] = 0.0
    points[100:103, 2] = -9999.0
    points[200] = [1e6, 0, 0]
    points[300, 1] = np.nan
    return points


def test_rules_mark_the_points_that_find_faults_marks():
    points = sick()
    rules = Rules.of(points[np.isfinite(points).all(1)])
    kinds = np.concatenate([rules.kinds(part) for part in np.array_split(points, 7)])
    harmful = [fault for fault in find_faults(points) if fault.harmful]
    assert len(harmful) == rules.count == 4
    for kind, fault in enumerate(harmful):
        rows = np.flatnonzero(kinds == kind)
        np.testing.assert_array_equal(rows, fault.rows)
        assert rules.sentence(kind, len(rows), len(points), int(rows[0]), points[rows[0]]) == fault.sentence
    assert (kinds == HEALTHY).sum() == len(points) - sum(len(fault.rows) for fault in harmful)


@pytest.mark.parametrize("seed", range(5))
def test_all_faults_that_a_sample_may_miss_are_suspicious(seed):
    points = sick()
    sample = points[np.random.default_rng(seed).choice(len(points), 1000, replace=False)]
    suspicious = Suspicion.of(sample[np.isfinite(sample).all(1)])(points)
    assert suspicious[100:103].all()
    assert suspicious[200]
    assert not suspicious[300]
    assert suspicious.sum() < 50


def test_a_healthy_cloud_has_no_rule():
    points = np.random.default_rng(0).normal(size=(2000, 3))
    assert Rules.of(points).count == 1
    assert (Rules.of(points).kinds(points) == HEALTHY).all()
