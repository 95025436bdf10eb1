import numpy as np

from pcsr_plugins.policies.expected_error import ExpectedError
from tests.exploration.scenes import NOTHING, TIP, ball, upper
from tests.plugins.policies.choosing import candidates

SEEN = upper(ball(600), above=0.0)


def test_a_hidden_side_has_the_greatest_gain():
    points = np.array([[0.0, 0.0, 15.0], [0.0, 0.0, -15.0]])
    surface = ball(400, seed=1)
    given = candidates(points)
    flipped = given.frames.copy()
    flipped[1] = np.diag([1.0, -1.0, -1.0])
    given = type(given)(points, flipped, given.presses, TIP, surface)
    above, below = ExpectedError().scores(given, SEEN, NOTHING)
    assert below > 10 * above > 0
    assert ExpectedError().error(given, SEEN, NOTHING) > below


def test_what_is_touched_gains_less():
    surface = ball(400, seed=1)
    below = candidates(np.array([[0.0, 0.0, -15.0]]))
    below = type(below)(below.points, np.diag([1.0, -1.0, -1.0])[None], below.presses, TIP, surface)
    patch = ball(20_000, seed=4)
    touched = patch[patch[:, 2] < -12]
    before, after = (ExpectedError().scores(below, SEEN, one)[0] for one in (NOTHING, touched))
    assert after < 0.2 * before
    assert ExpectedError().error(below, SEEN, touched) < ExpectedError().error(below, SEEN, NOTHING)
