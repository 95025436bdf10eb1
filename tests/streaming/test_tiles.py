"""Tiles of about equal size that cover space without overlap."""

import numpy as np
import pytest

from pcsr.streaming.tiles import TileTree, box_distance, boxes_apart, depth_for


@pytest.mark.parametrize("depth", [0, 1, 3, 6])
def test_tiles_have_equal_shares_and_are_boxes(depth):
    points = np.random.default_rng(0).normal(size=(6400, 3)) * [1, 30, 1]
    tree = TileTree.of(points, depth)
    tiles = tree.tiles(points)
    assert set(tiles) == set(range(2**depth))
    assert np.bincount(tiles).max() - np.bincount(tiles).min() <= 2 * depth
    for tile in range(2**depth):
        inside = points[tiles == tile]
        box = (points >= inside.min(0)).all(1) & (points <= inside.max(0)).all(1)
        assert (tiles[box] == tile).all()


def test_a_few_far_points_do_not_choose_the_axis():
    points = np.random.default_rng(0).uniform(size=(1000, 3)) * [1, 10, 0]
    points[:20, 2] = 1e6
    assert TileTree.of(points, 1).axes[0] == 1


def test_a_sample_divides_all_points_about_equally():
    points = np.random.default_rng(1).normal(size=(50_000, 3))
    tiles = TileTree.of(points[::10], 4).tiles(points)
    assert np.bincount(tiles).max() < 1.3 * len(points) / 16


@pytest.mark.parametrize(("count", "most", "depth"), [(100, 100, 0), (101, 100, 1), (400, 100, 2), (5, 100, 0)])
def test_the_depth_follows_from_the_largest_tile(count, most, depth):
    assert depth_for(count, most) == depth


def test_distances_of_boxes():
    lower, upper = np.zeros(3), np.ones(3)
    np.testing.assert_allclose(
        box_distance(np.array([[0.5, 0.5, 0.5], [2, 1, 1], [-3, 5, 0]]), lower, upper), [0, 1, 5]
    )
    lowers, uppers = np.array([[0.5, 0, 0], [4, 5, 0]]), np.array([[9.0, 1, 1], [6, 6, 1]])
    np.testing.assert_allclose(boxes_apart(lower, upper, lowers, uppers), [0, 5])
