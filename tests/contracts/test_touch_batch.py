"""Touches and their mask in one record."""

import torch

from pcsr import TouchBatch


def test_without_a_mask_every_touch_is_present_and_the_features_are_the_coordinates():
    points = torch.randn(2, 3, 5, 3)
    touches = TouchBatch.of(points)
    assert touches.mask.shape == (2, 3)
    assert touches.mask.all()
    assert touches.features is touches.points is points


def test_all_touched_points_of_a_row_are_in_one_axis():
    mask = torch.tensor([[True, False], [True, True]])
    touches = TouchBatch(torch.randn(2, 2, 3, 3), torch.randn(2, 2, 3, 4), mask)
    assert torch.equal(touches.flat, touches.features.reshape(2, 6, 4))
    assert torch.equal(touches.flat_points, touches.points.reshape(2, 6, 3))
    assert touches.flat_padding.tolist() == [[False] * 3 + [True] * 3, [False] * 6]


def test_there_may_be_no_touches():
    touches = TouchBatch.of(torch.zeros(2, 0, 7, 3))
    assert touches.mask.shape == touches.flat_padding.shape == (2, 0)
    assert touches.flat.shape == (2, 0, 3)
