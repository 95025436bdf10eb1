import numpy as np

from tests.plugins.policies.choosing import NOTHING, order


def test_the_farthest_from_cloud_and_touches_is_first():
    seen = np.array([[9.0, y, 0] for y in range(4)])
    assert order("sparse", seen, NOTHING) == list(range(10))
    touched = np.array([[0.0, y, 0] for y in range(4)])
    assert order("sparse", seen, touched)[:2] in ([4, 5], [5, 4])
