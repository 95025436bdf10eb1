"""Nearest points, searched once."""

import numpy as np

from pcsr.upsample.gaps import spacing, strays
from pcsr.upsample.neighbours import MOST, Neighbours
from pcsr.upsample.noise import Quadrics
from pcsr.upsample.selection import pattern
from pcsr.upsample.wires import on_wires


def cloud(count):
    return np.random.default_rng(count).normal(size=(count, 3))


def test_they_are_those_of_a_slow_search():
    points = cloud(60)
    away = np.linalg.norm(points[:, None] - points, axis=2)
    found = Neighbours.of(points)
    np.testing.assert_array_equal(found.index, np.argsort(away, axis=1)[:, :MOST])
    np.testing.assert_allclose(found.distances, np.sort(away, axis=1)[:, :MOST])
    mean = np.sort(away, axis=1)[:, 1:7].mean(1)
    np.testing.assert_allclose(found.mean_distance, mean)
    np.testing.assert_allclose(found.median_around(9), np.median(mean[found.index[:, :9]], axis=1))


def test_few_points_have_fewer_and_what_was_found_is_not_searched_again():
    found = Neighbours.of(cloud(5))
    assert found.index.shape == (5, 5)
    assert Neighbours.of(found, 2) is found


def test_a_wider_search_changes_nothing_that_is_derived_from_it():
    points = cloud(80)
    found, unit = Neighbours.of(points), spacing(points)
    np.testing.assert_array_equal(spacing(found), unit)
    np.testing.assert_array_equal(strays(found), strays(points))
    np.testing.assert_array_equal(on_wires(found), on_wires(points))
    np.testing.assert_array_equal(pattern(found, unit), pattern(points, unit))
    np.testing.assert_array_equal(Quadrics.fit(found, unit).residual, Quadrics.fit(points, unit).residual)
