"""Contacts in signals of depth: each touch once, at its deepest, whatever noise, rate and rest there are."""

import numpy as np
import pytest

from pcsr.recorded.bags.contacts import LEAST, contacts, threshold

DEPTHS = [1.0, 0.3, 2.0, 0.5, 1.5]


def signal(*, rate=30.0, rest=2.0, hold=1.0, noise=0.02, level=0.0, seed=0):
    """Touches of these depths: times in nanoseconds, depths in mm, and the first and last second of each touch."""
    corners, spans = [(0.0, 0.0)], []
    for depth in DEPTHS:
        start = corners[-1][0] + rest
        corners += [(start, 0), (start + 0.5, depth), (start + 0.5 + hold, depth), (start + 1 + hold, 0)]
        spans.append((start, start + 1 + hold))
    corners.append((corners[-1][0] + rest, 0))
    times = np.arange(0, corners[-1][0], 1 / rate)
    depths = np.interp(times, *np.array(corners).T) * (1 + 0.1 * np.sin(7 * times))
    depths += level + noise * np.abs(np.random.default_rng(seed).normal(size=len(times)))
    return (times * 1e9).astype(np.int64), depths, spans


@pytest.mark.parametrize(
    "how",
    [
        {},
        {"noise": 0.1},
        {"noise": 0.0},
        {"level": 0.1},
        {"rate": 5},
        {"rate": 100, "noise": 0.05},
        {"rest": 0.4},
        {"hold": 0.0},
        {"hold": 60.0, "rate": 10},
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_each_touch_is_found_once_where_it_is_deepest(how, seed):
    times, depths, spans = signal(**how, seed=seed)
    found = contacts(depths, times)
    assert len(found) == len(spans)
    for index, (start, stop), depth in zip(found, spans, DEPTHS, strict=True):
        assert start < times[index] / 1e9 < stop
        assert depths[index] > 0.8 * depth


def test_single_messages_that_are_wrong_have_no_effect():
    times, depths, spans = signal()
    wrong = depths.copy()
    wrong[::37] = 5.0
    wrong[20::37] = 0.0
    found = contacts(wrong, times)
    assert len(found) == len(spans)
    assert not set(found) & set(range(0, len(depths), 37))


def test_the_middle_of_a_symmetric_press_is_taken():
    times = np.arange(41, dtype=np.int64) * 10**8
    assert contacts(1 - ((times / 1e9 - 2.0) / 2) ** 2, times) == [20]


def test_messages_that_are_seconds_apart_are_contacts_of_their_own():
    times = np.arange(5, dtype=np.int64) * 10 * 10**9
    assert contacts(np.array([1.0, 0.8, 0.05, 1.2, 0.5]), times) == [0, 1, 3, 4]


def test_contacts_at_the_beginning_and_the_end_count():
    times = np.arange(30, dtype=np.int64) * 10**8
    depths = np.zeros(30)
    depths[:10] = 1.0
    depths[20:] = np.linspace(0.1, 0.9, 10)
    assert contacts(depths, times) == [4, 29]
    assert len(contacts(np.ones(30), times)) == 1


def test_without_messages_or_depth_there_is_no_contact():
    assert contacts(np.zeros(0), np.zeros(0, np.int64)) == []
    assert threshold(np.zeros(0), np.zeros(0, np.int64)) == LEAST
    times = np.arange(100, dtype=np.int64) * 10**8
    for depths in (np.zeros(100), np.full(100, -3.0), np.full(100, 0.9 * LEAST)):
        assert contacts(depths, times) == []


def test_noise_and_deep_touches_raise_the_threshold():
    times = np.arange(1000, dtype=np.int64) * 10**7
    noise = np.random.default_rng(0).normal(size=1000)
    assert threshold(0.1 * noise, times) == pytest.approx(0.5, rel=0.1)
    depths = np.zeros(1000)
    depths[300:600] = 4.0
    assert threshold(depths, times) == pytest.approx(0.4)


def test_slow_presses_in_few_messages_a_second_are_no_noise():
    """Three presses of 2 s in 5 messages a second: the indentation changes in most messages."""
    times = np.arange(33, dtype=np.int64) * 200_000_000
    press = 0.75 * np.sin(np.pi * np.arange(11) / 10)
    depths = np.tile(press, 3)
    assert contacts(depths, times) == [5, 16, 27]
