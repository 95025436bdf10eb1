"""Candidates in a row, for the tests of policies."""

import numpy as np

from pcsr import Fingertip, TouchCandidates
from pcsr.plugins.loading import load_plugins

NOTHING = np.zeros((0, 3))
TIP = Fingertip("digit", (16.0, 12.0), (27.0, 18.0), 2.0)
ROW = np.array([[float(x), 0, 0] for x in range(10)])


def candidates(points=ROW):
    """Candidates whose axes are z."""
    return TouchCandidates(points, np.stack([np.eye(3)] * len(points)), np.ones(len(points)), TIP)


def order(policy, seen, touched, points=ROW):
    """The order in which a policy touches the candidates."""
    return list(load_plugins().get("policy", policy)().order(candidates(points), seen, touched))
