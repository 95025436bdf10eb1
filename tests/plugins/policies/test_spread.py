import numpy as np

from tests.plugins.policies.choosing import NOTHING, order


def test_the_farthest_from_all_touches_is_first():
    assert order("spread", np.array([[9.0, 0, 0]]), np.zeros((1, 3))) == list(range(9, -1, -1))
    assert order("spread", NOTHING, np.array([[0.0, 0, 0], [9.0, 0, 0]]))[0] in (4, 5)


def test_before_the_first_touch_the_order_is_kept():
    assert order("spread", np.zeros((1, 3)), NOTHING) == list(range(10))
