"""One object: truth, sparse cloud and touches in one frame, each drawn as it is said."""

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import KDTree

from pcsr import ShapeItem, Touch, TouchSource, UserError
from pcsr.data.sample import KINDS, covered, covered_points, item_seed, make_sample

BALL = trimesh.creation.icosphere(subdivisions=3, radius=2.0).apply_translation([10.0, 0.0, 0.0])
ITEM = ShapeItem("shelf/ball", "balls", BALL)


class Corner(TouchSource):
    """Touches of one spot each, and a note of what it was asked."""

    def __init__(self, sizes=(30, 30, 30)):
        self.sizes, self.asked = sizes, []

    def touches(self, item, cloud, count, seed):
        self.asked.append((item.name, cloud, count, seed))
        order = np.linalg.norm(BALL.vertices - BALL.vertices[0], axis=1).argsort()
        return [Touch.single(BALL.vertices[order[:size]], np.eye(4), 1.0, "corner") for size in self.sizes[:count]]


def made(recipe, *overrides, touches=2, seed=0, item=ITEM, source=None):
    return make_sample(item, source or Corner(), recipe("points=32", "rate=8", *overrides).data, touches, seed)


def spacing(cloud):
    return KDTree(cloud).query(cloud, k=2)[0][:, 1]


@pytest.mark.parametrize("sampling", ["random", "poisson", "fps"])
def test_the_sparse_cloud_is_part_of_the_truth(recipe, sampling):
    one = made(recipe, f"sampling={sampling}")
    assert one.truth.shape == (256, 3)
    assert one.points.shape == (32, 3)
    assert {tuple(p) for p in one.points} < {tuple(p) for p in one.truth}


def test_what_is_asked_for_is_drawn(recipe):
    gaps = {name: spacing(made(recipe, f"sampling={name}").points).min() for name in ("random", "poisson", "fps")}
    assert gaps["random"] < 0.6 * gaps["poisson"]
    assert gaps["random"] < 0.6 * gaps["fps"]
    truths = {name: spacing(made(recipe, f"truth={name}").truth) for name in ("poisson", "fps")}
    assert truths["fps"].min() > 0.6 * truths["fps"].mean()
    assert not np.array_equal(truths["fps"], truths["poisson"])


def test_mixed_is_each_of_the_kinds_for_about_a_quarter_of_the_objects(recipe):
    def kind(one):
        """Found by whether it is part of the truth, and how even it is."""
        if not {tuple(p) for p in one.points} <= {tuple(p) for p in one.truth}:
            return "view"
        even = spacing(one.points).min() / spacing(one.points).max()
        return "random" if even < 0.25 else "even"

    names = [f"ball {i}" for i in range(40)]
    kinds = [kind(made(recipe, "sampling=mixed", touches=0, item=ShapeItem(name, "balls", BALL))) for name in names]
    assert set(KINDS) == {"random", "poisson", "fps", "view"}
    for name, share in [("random", 10), ("even", 20), ("view", 10)]:
        assert kinds.count(name) == pytest.approx(share, abs=9), kinds  # three standard deviations
    again = made(recipe, "sampling=mixed", touches=0, item=ShapeItem(names[0], "balls", BALL))
    assert np.array_equal(
        again.points, made(recipe, "sampling=mixed", touches=0, item=ShapeItem(names[0], "", BALL)).points
    )


def test_the_truth_of_an_object_is_the_same_however_its_cloud_is_drawn(recipe):
    one, other = made(recipe, "sampling=mixed"), made(recipe, "sampling=random")
    assert np.array_equal(one.truth, other.truth)


def test_a_camera_sees_one_side(recipe):
    one = made(recipe, "sampling=view")
    axis = one.points.mean(0)
    assert np.linalg.norm(axis) > 0.5
    assert (one.points @ axis).min() > 0
    assert (one.truth @ axis).min() < -0.5


def test_all_clouds_are_in_the_frame_in_which_the_truth_fills_the_unit_sphere(recipe):
    one = made(recipe)
    np.testing.assert_allclose(one.truth.mean(0), 0, atol=1e-6)
    assert np.linalg.norm(one.truth, axis=1).max() == pytest.approx(1, abs=1e-6)
    np.testing.assert_allclose(one.sphere.denormalize(one.touches[0]), sorted_vertices()[:30], atol=1e-5)
    assert np.linalg.norm(one.sphere.denormalize(one.points) - [10, 0, 0], axis=1).max() < 2.001


def sorted_vertices():
    return BALL.vertices[np.linalg.norm(BALL.vertices - BALL.vertices[0], axis=1).argsort()]


def test_the_source_is_told_what_the_camera_sees(recipe):
    source = Corner()
    one = made(recipe, source=source)
    name, cloud, count, _ = source.asked[0]
    assert (name, count) == ("shelf/ball", 2)
    np.testing.assert_allclose(one.sphere.normalize(cloud), one.points)


def test_no_touches_ask_nobody(recipe):
    source = Corner()
    one = made(recipe, touches=0, source=source)
    assert one.touches.shape == (0, 0, 3)
    assert (source.asked, one.coverage, one.sensor) == ([], (), "")


@pytest.mark.parametrize("sizes", [(30,), (30, 20), ()])
def test_a_source_that_gives_something_else_is_named(recipe, sizes):
    with pytest.raises(UserError, match=r"shelf/ball: its touch source returned .* instead of 2 touches of equal size"):
        made(recipe, source=Corner(sizes))


def test_seed_and_name_alone_decide_it(recipe):
    same, other = made(recipe, seed=3), made(recipe, seed=4)
    assert np.array_equal(made(recipe, seed=3).truth, same.truth)
    assert not np.array_equal(other.truth, same.truth)
    renamed = made(recipe, seed=3, item=ShapeItem("another", "balls", BALL))
    assert not np.array_equal(renamed.truth, same.truth)


@given(seed=st.integers(0, 2**32 - 1), name=st.text(max_size=20))
def test_item_seeds_are_seeds(seed, name):
    assert 0 <= item_seed(seed, name) < 2**64
    assert item_seed(seed, name) == item_seed(seed, name)
    assert item_seed(seed, name) != item_seed(seed, name + "x")


def slowly_covered(truth, touches):
    touched, shares = [False] * len(truth), []
    for touch in touches:
        gaps = [min(np.linalg.norm(p - q) for j, q in enumerate(touch) if j != i) for i, p in enumerate(touch)]
        for k, point in enumerate(truth):
            touched[k] = touched[k] or min(np.linalg.norm(point - p) for p in touch) < 2 * np.mean(gaps)
        shares.append(sum(touched) / len(truth))
    return tuple(shares)


@given(seed=st.integers(0, 1000))
def test_coverage_agrees_with_the_slow_way_and_never_falls(seed):
    rng = np.random.default_rng(seed)
    truth = rng.uniform(-1, 1, (40, 3))
    touches = [rng.uniform(-0.5, 0.5, (6, 3)) for _ in range(3)]
    shares = covered(truth, touches)
    assert shares == pytest.approx(slowly_covered(truth, touches))
    assert list(shares) == sorted(shares)


def test_repeated_points_of_a_touch_do_not_shrink_what_it_covers():
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 5)] * 2, [0.0]), -1).reshape(-1, 3)
    assert covered(grid, [np.repeat(grid[:10], 3, axis=0)]) == covered(grid, [grid[:10]])
    assert covered(grid, [grid[:1]]) == (0.0,)


@pytest.mark.parametrize("wrong", [np.nan, 1000.0])
def test_touches_of_nowhere_are_refused(recipe, wrong):
    class Elsewhere(Corner):
        def touches(self, item, cloud, count, seed):
            return [
                Touch.single(touch.points * wrong, np.eye(4), 1.0, "corner")
                for touch in super().touches(item, cloud, count, seed)
            ]

    with pytest.raises(UserError, match=r"shelf/ball: touch 0 lies .* another unit or frame"):
        made(recipe, source=Elsewhere())


@given(seed=st.integers(0, 1000))
def test_coverage_is_the_share_that_any_of_the_touches_covers(seed):
    rng = np.random.default_rng(seed)
    truth = rng.uniform(-1, 1, (40, 3))
    touches = [rng.uniform(-0.5, 0.5, (6, 3)) for _ in range(3)]
    touched = covered_points(truth, touches)
    assert touched.shape == (3, 40)
    assert covered(truth, touches) == tuple(touched[: k + 1].any(0).mean() for k in range(3))
    for row, touch in zip(touched, touches, strict=True):
        assert np.array_equal(covered_points(truth, [touch])[0], row), "a touch covers the same beside others"
    assert covered_points(truth, []).shape == (0, 40)
    assert covered(truth, []) == ()
