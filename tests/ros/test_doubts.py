"""What is odd about transforms that can be used."""

import numpy as np
import pytest

from pcsr import UserError
from pcsr.ros.doubts import JUMPS, doubt
from pcsr.ros.transforms import Transforms
from tests.ros.test_transforms import SECOND, add


def smooth(count=12):
    times = np.linspace(0, 0.5, count)
    return np.stack([np.sin(9 * times), 0.3 * times, 0 * times], axis=1)


def test_a_frame_that_moves_or_rests_is_not_odd():
    for positions in (smooth(), np.zeros((12, 3)), smooth(2), np.full((9, 3), np.nan), np.zeros((0, 3))):
        assert doubt("tool", ["base"] * len(positions), positions) is None
    trembling = np.random.default_rng(0).normal(size=(12, 3))
    assert doubt("tool", ["base"] * 12, trembling) is None


def test_two_programs_that_publish_one_transform_are_noticed():
    positions = smooth()
    positions[::2, 2] += JUMPS
    assert doubt("tool", ["base"] * 12, positions) == (
        "frame 'tool' jumps back and forth: two programs seem to publish its transforms"
    )


def moved(*transforms):
    """The doubts after the pose of the tool at 1 s was asked for."""
    found = Transforms()
    for one in transforms:
        add(found, *one)
    found.matrix("tool", "base", SECOND)
    found.matrix("tool", "base", SECOND)
    return found.doubts


def test_frames_of_several_parents_or_transforms_are_noticed_once():
    moving = ("tool", "base", 1.0, (1, 0, 0))
    assert moved(moving, ("base", "tool2", 1.0)) == []
    assert moved(moving, ("tool", "hand", 1.1)) == [
        "frame 'tool' has several parents within 0.25 s, 'base', 'hand': that of the nearest time is used"
    ]
    assert moved(moving, ("tool", "hand", 1.3)) == []
    assert moved(moving, ("tool", "base", None, (1, 0, 0))) == []
    assert moved(moving, ("tool", "base", None, (2, 0, 0))) == [
        "frame 'tool' has another static transform beside those of /tf: it is not used"
    ]
    still = ("tool", "base", None, (1, 0, 0))
    assert moved(still, still) == []
    assert moved(still, ("tool", "base", None, (2, 0, 0))) == [
        "frame 'tool' has several static transforms that differ: the last is used"
    ]
    assert moved(moving, ("other", "base", None), ("other", "hand", None)) == []


def test_no_frame_is_farther_away_than_the_earth_is_large():
    with pytest.raises(UserError, match=r"'tool' to 'base' is longer than the earth is large: \[0.0, 1e\+300"):
        moved(("tool", "base", 1.0, (0, 1e300, 0)))
