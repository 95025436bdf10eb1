"""Touches of a surface that the cloud does not show constrain each other."""

import numpy as np
from scipy.spatial import cKDTree

import pcsr
from pcsr.registration.likelihood import Likelihood
from pcsr.registration.neighbourhood import Neighbourhood
from pcsr.registration.overlaps import COUNTED, KEPT, Overlaps


def touch(middle, height):
    """A touch of a plane at a height, 8 × 8 mm, from above."""
    x, y = np.meshgrid(np.linspace(-4, 4, 21), np.linspace(-4, 4, 21))
    points = np.column_stack([x.ravel() + middle, y.ravel(), np.full(x.size, height)])
    pose = np.eye(4)
    pose[:3, 3] = middle, 0, height - 0.5
    return pcsr.Touch.single(points, pose, unit=1.0, sensor="pad")


def cloud():
    """A plane that both touches are far above."""
    rng = np.random.default_rng(0)
    return np.column_stack([rng.uniform(-30, 30, (2000, 2)), np.full(2000, -20.0)])


def test_overlapping_touches_of_a_hidden_side_move_towards_each_other():
    reported = [touch(0.0, 0.0), touch(3.0, 1.2)]
    found = pcsr.register(reported, cloud()).touches
    heights = [one.motion[2, 3] + of.points[0, 2] for one, of in zip(found, reported, strict=True)]
    assert abs(heights[1] - heights[0]) < 0.8
    assert all(one.support == 0 for one in found)


def test_touches_apart_do_not_change_each_other():
    apart = [touch(-25.0, 0.0), touch(25.0, 1.2)]
    alone = [pcsr.register([one], cloud()).touches[0] for one in apart]
    for one, other in zip(pcsr.register(apart, cloud()).touches, alone, strict=True):
        np.testing.assert_allclose(one.motion, other.motion, atol=1e-9)


def test_only_what_is_near_counts_and_not_too_much_of_it():
    of = cloud()
    one = Neighbourhood.of(touch(0.0, 0.0), cKDTree(of), of.mean(0), 5.0)
    plain = Likelihood(one.surfaces, one.near, one.near_spacing)
    others = Overlaps()
    assert others.around(one, plain, 5.0) is plain
    others.add(np.full((500, 3), 1e3), np.ones(500))
    assert others.around(one, plain, 5.0) is plain
    for _ in range(4):
        others.add(one.origin + np.random.default_rng(0).normal(size=(500, 3)), np.full(500, 0.3))
    with_others = others.around(one, plain, 5.0)
    assert len(others.points[1]) == KEPT
    assert len(with_others.others) == COUNTED
    assert with_others.of_cloud == len(plain.points)
    np.testing.assert_allclose(with_others.others, 0.09)
