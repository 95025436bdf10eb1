import numpy as np

from tests.plugins.policies.choosing import NOTHING, order


def test_the_random_order_of_the_candidates_is_kept():
    for seen, touched in ((NOTHING, NOTHING), (np.zeros((1, 3)), np.ones((2, 3)))):
        assert order("grasp", seen, touched) == list(range(10))
