"""What is found in a cloud: each fault with its number and an example, and nothing in healthy clouds."""

import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr.clouds.faults import find_faults


def bowl(count=300, seed=0, at=(0, 0, 0)):
    xy = np.random.default_rng(seed).uniform(-1, 1, (count, 2))
    return np.column_stack([xy, 0.3 * xy[:, 0] ** 2 + 0.1 * xy[:, 1]]) + at


def lidar(count=3000, largest=200.0):
    """A street as a scanner sees it: between 1 m and `largest`, each decade with equally many points."""
    rng = np.random.default_rng(1)
    distance, angle = np.exp(rng.uniform(0, np.log(largest), count)), rng.uniform(0, 2 * np.pi, count)
    return np.column_stack([distance * np.cos(angle), distance * np.sin(angle), rng.normal(0, 0.05, count)])


def tower():
    rng = np.random.default_rng(2)
    ground = rng.uniform(-50, 50, (2000, 2))
    mast = np.column_stack([rng.uniform(0, 0.5, (60, 2)), rng.uniform(0, 300, 60)])
    return np.concatenate([np.column_stack([ground, np.sin(ground[:, 0])]), mast])


def soup():
    """The corners of the triangles of a cone: its tip and the middle of its base are each in a third of them."""
    angle = np.arange(64) * np.pi / 32
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(64)])[np.arange(65) % 64]
    sides = [[ring[i], ring[i + 1], [0, 0, 2]] for i in range(64)]
    return np.array(sides + [[ring[i], ring[i + 1], [0, 0, 0]] for i in range(64)], float).reshape(-1, 3)


RNG = np.random.default_rng(3)
HEALTHY = {
    "bowl": bowl(),
    "with the origin once": np.concatenate([bowl(), [[0, 0, 0]]]),
    "with the origin once, apart": np.concatenate([bowl(at=(0, 0, 2)), [[0, 0, 0]]]),
    "plane at z = 0": bowl() * [1, 1, 0],
    "line": np.linspace(0, 1, 100)[:, None] * [1, 0, 0],
    "line on an axis, uneven": np.cumsum(RNG.exponential(size=200))[:, None] * [0, 0, 1],
    "two planes": np.concatenate([bowl() * [1, 1, 0], bowl() * [1, 1, 0] + [0, 0, 1]]),
    "two objects": np.concatenate([bowl(), bowl(30, 1, at=(100, 0, 0))]),
    "two objects, one of 17 points": np.concatenate([bowl(2000), bowl(17, 1, at=(500, 0, 0))]),
    "scan lines": np.stack(np.meshgrid(np.linspace(0, 1, 400), np.linspace(0, 10, 8), [0]), -1).reshape(-1, 3),
    "range from 1 to 200 m": lidar(),
    "terrain with a tower": tower(),
    "normally distributed": RNG.normal(size=(1000, 3)),
    "in millimetres, through 65535": np.linspace(0, 131070, 201)[:, None] * [1, 0.5, 0.1],
    "some outliers of a scan": np.concatenate([bowl(2000), RNG.uniform(-4, 4, (40, 3))]),
    "few": bowl(16),
    "UTM": bowl(at=(500_000, 5_400_000, 300)),
}
REPEATED = {
    "integers": RNG.poisson(2, (2000, 3)).astype(float),
    "rounded": np.round(lidar(), 0),
    "each eight times": np.repeat(bowl(), 8, axis=0),
    "cone of separate triangles": soup(),
    "each of two scans": np.concatenate([bowl(), bowl()[:100]]),
}
FLAT = np.random.default_rng(4).uniform(0, 1000, (90, 2))
PIXELS = np.random.default_rng(5).uniform(-0.5, 0.5, (90, 2)) * 65.535
SINGLE = float(np.finfo(np.float32).max)
HARMFUL = {
    "zeros before the camera": (bowl(at=(0, 0, 2)), [[0, 0, 0]] * 50, "(0, 0, 0)"),
    "zeros within the object": (bowl(), [[0, 0, 0]] * 50, "(0, 0, 0)"),
    "negative zeros too": (bowl(), [[0, 0, 0], [-0.0, 0, -0.0]] * 20, "(0, 0, 0)"),
    "three zeros before the camera": (bowl(at=(0, 0, 2)), [[0, 0, 0]] * 3, "(0, 0, 0)"),
    "more zeros than points": (bowl(20), [[0, 0, 0]] * 5000, "(0, 0, 0)"),
    "zeros of clouds with copies": (np.repeat(bowl(), 8, axis=0), [[0, 0, 0]] * 4000, "(0, 0, 0)"),
    "zeros moved by a pose": (bowl(), [[3.1, 0.2, 0.5]] * 50, "(3.1, 0.2, 0.5)"),
    "ones": (bowl(), [[-1, -1, -1]] * 50, "(-1, -1, -1)"),
    "depth -1": (bowl(at=(0, 0, 2)), [[0, 0, -1]] * 50, "(0, 0, -1)"),
    "elevation model": (bowl() * [1000, 1000, 50], np.column_stack([FLAT, np.full(90, -9999)]), "z = -9999"),
    "16 bits": (bowl() * 1000, np.column_stack([FLAT, np.full(90, 65535)]), "z = 65535"),
    "16 bits in metres": (bowl(), np.column_stack([PIXELS, np.full(90, np.float32(65.535))]), "z = 65.535"),
    "short integers": (bowl() * 100, np.full((9, 3), -32768), "x = -32768"),
    "largest float": (bowl(), np.full((200, 3), SINGLE), "x = 3.402823e+38"),
    "largest double": (bowl(), np.full((200, 3), -np.finfo(float).max), "x = -1.797693e+308"),
    "one at 1e10": (bowl(), [[1e10, 1e10, 1e10]], "x = 1e+10"),
    "one far": (bowl(), [[0, 1e6, 0]], "far away"),
    "one not so far": (bowl(), [[100, 0, 0]], "far away"),
    "one at any size": (bowl(), [[1e300, 0, 0]], "far away"),
    "one in a cloud of few": (bowl(16), [[0, 0, 1e6]], "far away"),
    "two on a far spot": (bowl(), [[1e5, 0, 0]] * 2, "far away"),
    "five close to one another": (bowl(), bowl(5, 6) + 1e5, "far away"),
    "some everywhere": (bowl(), np.random.default_rng(7).normal(size=(20, 3)) * 1e7, "far away"),
    "a row of them": (bowl(), 10.0 ** np.arange(2, 9)[:, None] * [1, 0, 0], "far away"),
    "one at the origin of UTM": (bowl(at=(500_000, 5_400_000, 300)), [[0, 0, 0]], "far away"),
    "not a number": (bowl(), [[np.nan, 0, 0], [0, np.inf, 0]], "not finite"),
}


@pytest.mark.parametrize("name", HEALTHY)
def test_a_healthy_cloud_has_no_fault(name):
    assert find_faults(HEALTHY[name]) == []


@pytest.mark.parametrize("name", REPEATED)
def test_copies_are_counted_and_no_harm(name):
    cloud = REPEATED[name]
    (fault,) = find_faults(cloud)
    assert not fault.harmful
    copies = len(cloud) - len(np.unique(cloud, axis=0))
    assert fault.sentence.startswith(f"{copies} of {len(cloud)} points are exact copies of others, such as point ")
    left = np.delete(cloud, fault.rows, axis=0)
    assert len(left) == len(np.unique(left, axis=0)) == len(cloud) - copies
    seen = set()
    naive = [row for row, point in enumerate(map(tuple, cloud.tolist())) if point in seen or seen.add(point)]
    assert fault.rows.tolist() == naive, "the first of the equal points is kept"


@pytest.mark.parametrize("name", HARMFUL)
@pytest.mark.parametrize("first", [False, True])
def test_a_fault_is_found_with_its_rows_and_an_example(name, first):
    cloud, bad, what = HARMFUL[name]
    bad = np.asarray(bad, float)
    whole = np.concatenate([bad, cloud] if first else [cloud, bad])
    rows = np.arange(len(bad)) + (0 if first else len(cloud))
    (fault, *copies) = find_faults(whole)
    assert fault.harmful
    np.testing.assert_array_equal(fault.rows, rows)
    assert what in fault.sentence
    assert fault.sentence.startswith(f"{len(bad)} of {len(whole)} points ha" if "far" not in what else f"{len(bad)} of")
    assert f"such as point {rows[0]}, counted from 0" in fault.sentence
    assert not any(fault.harmful for fault in copies)
    assert bool(copies) == (len(np.unique(cloud, axis=0)) < len(cloud))


def rounded_copies(points, each=8, seed=0):
    """Each point several times in single precision, every coordinate moved by a step at most."""
    single = np.repeat(points, each, axis=0).astype(np.float32)
    up, down = (np.nextafter(single, np.float32(side)) for side in (np.inf, -np.inf))
    step = np.random.default_rng(seed).integers(-1, 2, single.shape)
    return np.select([step > 0, step < 0], [up, down], single).astype(np.float64)


@pytest.mark.parametrize("at", [(0, 0, 0), (5, -3, 2), (100, 20, 0)])
@pytest.mark.parametrize("count", [20, 1000])
def test_copies_in_the_last_bit_are_counted_and_no_harm(at, count):
    cloud = rounded_copies(bowl(count, at=at))
    order = np.random.default_rng(1).permutation(len(cloud))
    exact, rounding = find_faults(cloud[order])
    assert not rounding.harmful
    assert f"{len(rounding.rows)} of {8 * count} points are copies of others but for rounding" in rounding.sentence
    original = order // 8
    left = np.setdiff1d(np.arange(len(cloud)), np.r_[exact.rows, rounding.rows])
    np.testing.assert_array_equal(left, np.sort(np.unique(original, return_index=True)[1]), "the first of each is left")


FINE = np.random.default_rng(8).uniform(0, 1, (3000, 3))
CLOSE = {
    "map coordinates, millimetres apart": FINE * [10, 10, 0.01] + (500_000, 5_400_000, 300),
    "map coordinates in single precision": np.unique((FINE * 1000 + 5e6).astype(np.float32), axis=0).astype(float),
    "a fine object in a wide scene": np.concatenate([FINE * 0.05, FINE[:1000] * 2000 - 1000]),
    "two objects, beside whose distance they are specks": np.concatenate([bowl(), bowl(at=(1e9, 0, 0))]),
}


@pytest.mark.parametrize("name", CLOSE)
def test_points_as_close_as_rounding_are_no_copies_if_others_are_close_too(name):
    assert find_faults(CLOSE[name]) == []


def test_several_faults_are_told_apart():
    cloud = np.concatenate(
        [bowl() + 3, [[np.nan] * 3], [[0, 0, 0]] * 20, [[-1, -1, -1]] * 30, [[1e7, 0, 0]], [[4, 4, 4]] * 2]
    )
    faults = find_faults(cloud)
    assert [len(fault.rows) for fault in faults] == [1, 30, 20, 1, 1]
    assert [fault.harmful for fault in faults] == [True] * 4 + [False]
    assert (
        faults[-1].sentence
        == "1 of 354 points is an exact copy of another, such as point 353 of point 352, counted from 0"
    )
    rows = np.concatenate([fault.rows for fault in faults])
    assert len(rows) == len(set(rows.tolist()))


def test_clouds_of_none_one_and_nothing_finite():
    assert find_faults(np.zeros((0, 3))) == []
    assert find_faults(np.zeros((1, 3))) == []
    (fault,) = find_faults(np.full((3, 3), np.nan))
    assert fault.rows.tolist() == [0, 1, 2]


CLOUDS = st.sampled_from([*HEALTHY.values(), *REPEATED.values()])
SICK = st.sampled_from([np.concatenate([cloud, bad]) for cloud, bad, _ in HARMFUL.values()])
MOVABLE = ("zeros before the camera", "ones", "one far", "one not so far", "two on a far spot", "some everywhere")


def found(points):
    return [fault.rows.tolist() for fault in find_faults(points)]


@given(CLOUDS, st.integers(-6, 6), st.lists(st.integers(-1000, 1000), min_size=3, max_size=3))
def test_neither_unit_nor_place_makes_a_healthy_cloud_sick(cloud, decade, place):
    moved = (cloud + place) * 2.0**decade
    assert not any(fault.harmful for fault in find_faults(moved))


@given(st.sampled_from(MOVABLE), st.integers(-20, 20), st.integers(-8, 8))
def test_neither_unit_nor_place_hides_a_fault(name, decade, place):
    cloud, bad, _ = HARMFUL[name]
    moved = (np.concatenate([cloud, bad]) + place) * 2.0**decade
    fault = find_faults(moved)[0]
    assert fault.harmful
    assert fault.rows.tolist() == list(range(len(cloud), len(moved)))


@given(st.one_of(CLOUDS, SICK), st.randoms(use_true_random=False))
def test_the_order_of_the_points_has_no_influence(cloud, random):
    order = list(range(len(cloud)))
    random.shuffle(order)
    harmful = [set(fault.rows.tolist()) for fault in find_faults(cloud) if fault.harmful]
    mixed = [{order[row] for row in fault.rows} for fault in find_faults(cloud[order]) if fault.harmful]
    assert mixed == harmful
    assert sum(map(len, found(cloud))) == sum(map(len, found(cloud[order])))


@given(st.integers(1, 14), st.floats(200, 1e12), st.integers(0, 1000))
def test_few_points_far_away_are_found_wherever_they_lie(count, distance, seed):
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=3)
    far = distance * direction / np.linalg.norm(direction) + rng.uniform(-1, 1, (count, 3))
    (fault,) = find_faults(np.concatenate([bowl(200, seed), far]))
    assert fault.rows.tolist() == list(range(200, 200 + count))


@pytest.mark.slow
def test_a_million_points_take_seconds():
    cloud = np.random.default_rng(0).normal(size=(1_000_000, 3))
    cloud[:1000] = 0
    cloud[1000] = 1e9
    start = time.process_time()
    assert [len(fault.rows) for fault in find_faults(cloud)] == [1000, 1]
    assert time.process_time() - start < 6, "3 s on one core of the machine it was written on"
