"""Clouds of simple bodies, in mm."""

import numpy as np

from pcsr import Fingertip

TIP = Fingertip("digit", gel=(16.0, 12.0), housing=(27.0, 18.0), protrusion=2.0)
NOTHING = np.zeros((0, 3))


def ball(count=500, radius=15.0, seed=0):
    """Random points of a sphere."""
    points = np.random.default_rng(seed).normal(size=(count, 3))
    return radius * points / np.linalg.norm(points, axis=1, keepdims=True)


def upper(points, above=-4.0):
    """The points above a height: the rest is hidden."""
    return points[points[:, 2] > above]


def plane(count=1500, side=60.0, seed=0):
    """Random points of a square."""
    flat = np.random.default_rng(seed).uniform(-side / 2, side / 2, (count, 2))
    return np.column_stack([flat, np.zeros(count)])
