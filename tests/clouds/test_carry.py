import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr import UserError
from pcsr.clouds import carry as module
from pcsr.clouds.carry import carry

RNG = np.random.default_rng(0)
QUATERNION = ["rot_0", "rot_1", "rot_2", "rot_3"]


def world(n, m, seed):
    rng = np.random.default_rng(seed)
    columns = {
        "red": rng.integers(0, 256, n).astype(np.uint8),
        "blue": rng.integers(0, 256, n).astype(np.int16),
        "green": rng.random(n),
        "colors": rng.integers(0, 65536, (n, 4)).astype(np.uint16),
        "nx": rng.normal(size=n),
        "intensity": rng.normal(size=n).astype(np.float32),
        "ny": rng.normal(size=n),
        "nz": rng.normal(size=n),
        "normals": rng.normal(size=(n, 3)).astype(np.float32),
        "label": rng.integers(-9, 9, n),
        "scalar_Classification": rng.integers(0, 9, n).astype(np.float32),
        "gps_time": 1e5 * rng.random(n),
        "intensity of 16 bits": rng.integers(0, 65536, n).astype(np.uint16),
        **{name: rng.normal(size=n) for name in QUATERNION},
        "seen": rng.random(n) < 0.5,
        "weights": rng.random((n, 2)),
    }
    return columns, rng.random((n, 3)), rng.random((m, 3))


def slow(columns, old, new, k):
    """The same, one point and one neighbour at a time."""
    made = {name: [] for name in columns}
    for point in new:
        distance = [float(np.linalg.norm(point - other)) for other in old]
        near = sorted(range(len(old)), key=distance.__getitem__)[:k]

        def mean(column, near=near, distance=distance):
            total = sum(1 / distance[i] for i in near)
            return sum(np.asarray(column[i], np.float64) / distance[i] for i in near) / total

        def direction(vectors, near=near, distance=distance):
            lengths = [float(np.linalg.norm(vectors[i])) for i in near]
            units = [vectors[i] / length for i, length in zip(near, lengths, strict=True)]
            total = np.zeros(vectors.shape[1])
            for i, unit in zip(near, units, strict=True):
                cosine = float(unit @ units[0])
                if abs(cosine) >= 0.5:
                    total += (unit if cosine > 0 else -unit) / distance[i]
            return total / np.linalg.norm(total)

        normal = direction(np.stack([columns["nx"], columns["ny"], columns["nz"]], axis=1))
        quaternion = direction(np.stack([columns[name] for name in QUATERNION], axis=1))
        for name, column in columns.items():
            if name in ("nx", "ny", "nz"):
                made[name].append(normal["xyz".index(name[1])])
            elif name in QUATERNION:
                made[name].append(quaternion[QUATERNION.index(name)])
            elif name == "normals":
                made[name].append(direction(column.astype(np.float64)))
            elif name in ("label", "seen", "scalar_Classification", "gps_time"):
                made[name].append(column[near[0]])
            else:
                value = mean(column)
                made[name].append(np.rint(value) if column.dtype.kind in "iu" else value)
    return {name: np.array(values).astype(columns[name].dtype) for name, values in made.items()}


@given(n=st.integers(1, 12), m=st.integers(0, 6), k=st.integers(1, 5), seed=st.integers(0, 1000))
def test_it_does_what_two_loops_do(n, m, k, seed):
    columns, old, new = world(n, m, seed)
    fast = carry(columns, old, new, k)
    assert list(fast) == list(columns)
    for name, expected in slow(columns, old, new, k).items():
        assert fast[name].dtype == columns[name].dtype
        assert fast[name].shape == (m, *columns[name].shape[1:])
        # One nearest point alone gives its normal as it is, of whatever length.
        if min(k, n) > 1 or name not in ("nx", "ny", "nz", "normals", *QUATERNION):
            np.testing.assert_allclose(fast[name], expected.reshape(fast[name].shape), rtol=1e-5, atol=1e-6)


def test_large_clouds_are_carried_in_parts_that_fit_together(monkeypatch):
    columns, old, new = world(50, 33, 1)
    whole = carry(columns, old, new)
    monkeypatch.setattr(module, "CHUNK", 7)
    for name, column in carry(columns, old, new).items():
        np.testing.assert_array_equal(column, whole[name])


def test_a_point_on_an_old_one_has_exactly_what_that_has():
    columns, old, _ = world(40, 0, 2)
    columns["huge"] = np.full(40, 1e308)
    order = RNG.permutation(40)
    for name, column in carry(columns, old, old[order]).items():
        assert column.tobytes() == columns[name][order].tobytes(), name


def test_what_is_the_same_everywhere_stays_exactly_the_same():
    _, old, new = world(40, 100, 3)
    colours = {name: np.full(40, value, np.uint8) for name, value in (("red", 255), ("green", 0), ("blue", 7))}
    columns = {"time": np.full(40, 0.1), "heat": np.full(40, 0.7, np.float32), **colours}
    for name, column in carry(columns, old, new).items():
        assert set(column.tolist()) == {columns[name][0].item()}


def test_means_stay_between_what_they_are_of():
    columns, old, new = world(40, 200, 4)
    for name in ("red", "blue", "colors", "intensity", "weights"):
        carried = carry(columns, old, new)[name]
        assert carried.min() >= columns[name].min()
        assert carried.max() <= columns[name].max()


def test_normals_have_length_one_and_the_sign_of_the_nearest():
    old = np.array([[0.0, 0, 0], [1, 0, 0]])
    normals = np.array([[0.0, 0, 1], [0, 0, -1]])
    columns = {"nx": normals[:, 0], "ny": normals[:, 1], "nz": normals[:, 2], "normal": normals}
    made = carry(columns, old, np.array([[0.5, 0.0, 0.0], [0.25, 0, 0], [0.75, 3, 0]]), 2)
    assert abs(made["nz"][0]) == 1
    assert made["nz"][1:].tolist() == [1, -1]
    np.testing.assert_array_equal(made["normal"], np.stack([made["nx"], made["ny"], made["nz"]], axis=1))


def test_normals_of_length_zero_stay_that():
    made = carry({"normals": np.zeros((3, 3))}, np.eye(3), np.zeros((1, 3)))
    assert made["normals"].tolist() == [[0, 0, 0]]


def test_what_is_not_finite_does_not_spread():
    old = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]])
    columns = {"time": np.array([1.0, np.nan, np.inf]), "normals": np.array([[0, 0, 1.0], [np.nan, 0, 0], [1, 0, 0]])}
    made = carry(columns, old, np.array([[0.1, 0, 0], [0.9, 0, 0], [1.9, 0, 0]]))
    np.testing.assert_array_equal(made["time"], [1, np.nan, np.inf])
    np.testing.assert_array_equal(made["normals"], columns["normals"])


def test_a_colour_alone_and_other_integers_are_labels():
    _, old, new = world(40, 100, 6)
    for names in (("red",), ("alpha",), ("label", "id"), ("r", "g")):
        columns = {name: np.arange(0, 4000, 100) for name in names}
        for column in carry(columns, old, new).values():
            assert not (column % 100).any()


def test_far_from_the_origin_the_same_comes_out():
    columns, old, new = world(40, 20, 5)
    shift = np.array([4e6, 5e6, 300.0])
    near, far = carry(columns, old, new), carry(columns, old + shift, new + shift)
    for name in columns:
        np.testing.assert_allclose(far[name].astype(float), near[name].astype(float), rtol=1e-4, atol=1)


def test_neither_columns_nor_new_points_need_be_there():
    assert carry({}, np.eye(3), np.eye(3)) == {}
    assert carry({"label": np.arange(3)}, np.eye(3), np.zeros((0, 3)))["label"].shape == (0,)


@pytest.mark.parametrize(
    ("columns", "old", "k", "reason"),
    [
        ({"label": np.arange(3)}, np.eye(3), 0, "k is 0, it must be 1 or more"),
        ({"label": np.arange(2)}, np.eye(3), 3, "column 'label' has 2 rows for 3 points"),
        ({}, np.zeros((0, 3)), 3, "the cloud that they belong to has no points"),
    ],
)
def test_what_cannot_be_carried_is_named(columns, old, k, reason):
    with pytest.raises(UserError, match=reason):
        carry(columns, old, np.eye(3), k)


def test_points_that_are_not_finite_are_named():
    bad = np.eye(3) / np.array([1, 1, np.nan])
    for old, new, which in ((bad, np.eye(3), "old"), (np.eye(3), bad, "new")):
        with pytest.raises(UserError, match=f"some of the {which} points are not finite: remove them"):
            carry({"label": np.arange(3)}, old, new)
