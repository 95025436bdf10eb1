"""A cloud of any size to any number of points, whatever its order, place, size or turn."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from pcsr import UserError
from pcsr.geometry.frames import OwnFrame
from pcsr.upsample import densify
from pcsr.upsample.candidates import Generated, Midpoints
from pcsr.upsample.dense import core_size
from pcsr.upsample.unseen import unseen
from pcsr.workers import worker_pool

SMALL = Midpoints(size=32, rate=8)


def bowl(count, seed=0):
    """Points of a lopsided paraboloid."""
    xy = np.random.default_rng(seed).uniform(-1, 1, (count, 2)) * [1.3, 1.0]
    return np.column_stack([xy, 0.4 * xy[:, 0] ** 2 + 0.2 * xy[:, 1] ** 3])


@pytest.mark.slow
@given(n=st.integers(16, 200), rate=st.floats(1.1, 12.0), keep=st.booleans(), seed=st.integers(0, 99))
@settings(max_examples=25)
def test_exactly_as_many_come_out_as_were_asked_for(n, rate, keep, seed):
    cloud = bowl(n, seed)
    count = round(rate * n)
    new = densify(cloud, count, SMALL, keep=keep).points
    assert new.shape == (count - n if keep else count, 3)
    assert np.isfinite(new).all()


@pytest.mark.slow
@pytest.mark.parametrize("count", [1000, 4000, 1001, 64 * 500])
def test_many_patches_and_many_passes_give_exactly_that_many(count):
    assert len(densify(bowl(500), count, SMALL).points) == count - 500


@pytest.mark.slow
@given(seed=st.integers(0, 99))
@settings(max_examples=15)
def test_the_order_of_the_cloud_does_not_matter(seed):
    cloud = bowl(120, seed)
    order = np.random.default_rng(seed).permutation(120)
    one, other = densify(cloud, 420, SMALL).points, densify(cloud[order], 420, SMALL).points
    assert cKDTree(one).query(other)[0].max() < 1e-9


@pytest.mark.slow
@given(seed=st.integers(0, 99), scale=st.floats(1e-3, 1e3), shift=st.floats(-1e3, 1e3))
@settings(max_examples=12)
def test_moving_turning_and_scaling_the_cloud_moves_the_result_alike(seed, scale, shift):
    cloud, turn = bowl(120, seed), Rotation.random(random_state=seed).as_matrix()
    one = (densify(cloud, 420, SMALL).points @ turn.T + shift) * scale
    other = densify((cloud @ turn.T + shift) * scale, 420, SMALL).points
    apart = cKDTree(one).query(other)[0] / scale
    # Where two gaps are of one size, the last digit may decide otherwise.
    assert np.quantile(apart, 0.85) < 1e-6


@pytest.mark.slow
def test_no_seams_show():
    rng = np.random.default_rng(0)
    sheet = np.column_stack([rng.uniform(0, 1, (4000, 2)), np.zeros(4000)])
    whole = np.concatenate([sheet, densify(sheet, 16000, Midpoints(size=256, rate=8)).points])
    from pcsr.geometry.patches import patches

    owner = np.zeros(len(sheet), int)
    for number, patch in enumerate(patches(sheet, 256, core_size(256))):
        owner[patch.rows[: patch.core]] = number
    inner = (np.abs(whole[:, :2] - 0.5) < 0.45).all(1)
    inside = whole[inner]
    two = cKDTree(sheet).query(inside, k=6)[1]
    at_seam = (owner[two] != owner[two[:, :1]]).any(1)
    gaps = cKDTree(whole).query(inside, k=5)[0][:, 1:].mean(1)
    assert 0.2 < at_seam.mean() < 0.9
    assert gaps[at_seam].mean() == pytest.approx(gaps[~at_seam].mean(), rel=0.03)


@pytest.mark.slow
def test_density_keeps_its_pattern():
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.uniform(0, 1, 3000), rng.uniform(1, 2, 1000)])
    sheet = np.column_stack([x, rng.uniform(0, 1, 4000), np.zeros(4000)])
    new = densify(sheet, 16000, Midpoints(size=256, rate=8)).points
    assert (new[:, 0] < 1).mean() == pytest.approx(0.75, abs=0.02)


def test_nothing_is_made_across_a_gap():
    rng = np.random.default_rng(0)
    halves = [rng.uniform(0, 1, (1500, 3)) * [1, 1, 0] + [x, 0, 0] for x in (0.0, 1.3)]
    new = densify(np.concatenate(halves), 12000, Midpoints(size=256, rate=8)).points
    assert not ((new[:, 0] > 1.06) & (new[:, 0] < 1.24)).any()


def test_touches_go_to_the_patches_that_they_meet():
    asked = []

    class Spy(Midpoints):
        def __call__(self, points, touches, rate):
            asked.append((points, touches))
            return super().__call__(points, touches, rate)

    cloud = bowl(400)
    low, *_, high = np.array_split(cloud[cloud[:, 0].argsort()] + 1e-3, 80)
    densify(cloud, 800, Spy(size=64, rate=8), touches=[low, high])
    met = [len(touches) for _, touches in asked]
    assert 0 < sum(met) < len(met)
    assert max(met) == 1
    for points, touches in asked:
        for touch in touches:
            assert (
                np.linalg.norm(touch - points.mean(0), axis=1).max()
                <= np.linalg.norm(points - points.mean(0), axis=1).max()
            )


def under(count, seed=0):
    """Touched points on a side of the bowl that the cloud does not show."""
    x, y = np.random.default_rng(seed).uniform(-0.3, 0.3, (2, count))
    return np.column_stack([x, y, np.full(count, -1.0)])


UNSEEN = "touched points lie up to .* from the cloud and are added to it as unseen surface"


@pytest.mark.parametrize("keep", [True, False])
def test_a_side_that_only_a_finger_reached_is_filled_too(keep):
    cloud, touch = bowl(400), under(500)
    with pytest.warns(UserWarning, match=UNSEEN):
        new = densify(cloud, 1600, SMALL, touches=[touch], keep=keep).points
    assert len(new) == 1600 - 400 * keep
    there = new[new[:, 2] < -0.9]
    touched = unseen(cloud, [touch])
    np.testing.assert_array_equal(new[: len(touched)], touched)  # themselves, and first
    assert cKDTree(there).query(touch)[0].max() < 0.15, "the whole touch is filled"
    density = len(there) / 0.36 / ((len(new) - len(there)) / 5.2)
    assert 0.5 < density < 2, "and about as dense as the rest"
    assert not ((new[:, 2] < -0.5) & (new[:, 2] > -0.95)).any(), "nothing is made between"


@pytest.mark.slow
@pytest.mark.parametrize("count", [401, 403, 64 * 400])
@pytest.mark.parametrize("keep", [True, False])
@pytest.mark.filterwarnings("ignore:.*touched points")
def test_with_touches_exactly_as_many_come_out_too(count, keep):
    assert len(densify(bowl(400), count, SMALL, touches=[under(500)], keep=keep).points) == count - 400 * keep


def test_touched_points_that_do_not_fit_into_the_count_are_said():
    with pytest.warns(UserWarning, match="only 3 of them fit into the count, so ask for more points"):
        densify(bowl(400), 403, SMALL, touches=[under(500)])


def test_touches_where_the_cloud_has_points_are_no_news():
    cloud = bowl(400)
    densify(cloud, 500, SMALL, touches=[cloud[:30] + 1e-3])  # a warning would be an error


@pytest.mark.slow
def test_more_processes_give_the_same_points():
    cloud = bowl(600)
    with worker_pool(2) as two:
        other = densify(cloud, 2000, SMALL, pool=two).points
    np.testing.assert_array_equal(densify(cloud, 2000, SMALL).points, other)


@pytest.mark.parametrize("rate", [3, 12])
def test_progress_rises_over_all_passes_and_ends_at_the_total(rate):
    calls = []
    densify(bowl(300), rate * 300, SMALL, advance=lambda done, total: calls.append((done, total)))
    done, totals = zip(*calls, strict=True)
    assert list(done) == sorted(set(done)), "no pass starts again"
    passes = 1 if rate == 3 else 2
    expected = sum(round(300 * rate ** (number / passes)) for number in range(passes))
    assert set(totals) == {done[-1]} == {expected}


@pytest.mark.parametrize(
    ("cloud", "count", "said"),
    [
        (bowl(15), 30, "the cloud has 15 points: at least 16 are needed"),
        (np.ones((20, 3)), 40, "all 20 points of the cloud lie on one spot"),
        (bowl(20), 19, "19 points are fewer than the 20 of the cloud"),
    ],
)
def test_what_cannot_be_done_is_said(cloud, count, said):
    with pytest.raises(UserError, match=said):
        densify(cloud, count, SMALL)


@pytest.mark.parametrize("rate", [3, 40])
def test_a_part_of_a_cloud_gets_new_points_and_the_rest_is_its_neighbourhood(rate):
    cloud = bowl(400)
    cloud = cloud[np.argsort(cloud[:, 0])]
    new = densify(cloud, 200 * rate, SMALL, core=200).points
    assert len(new) == 200 * (rate - 1)
    nearest = cKDTree(cloud).query(new)[1]
    assert (nearest < 200).mean() > 0.98
    other = densify(cloud[::-1], 200 * rate, SMALL, core=200).points
    whole = densify(cloud, 400 * rate, SMALL).points
    between = cloud[199:201, 0].mean()
    counts = [(np.abs(each[:, 0] - between) < 0.15).sum() for each in (np.concatenate([new, other]), whole)]
    assert counts[0] == pytest.approx(counts[1], rel=0.1)


def test_a_part_that_is_the_whole_cloud_is_no_other_case():
    whole = densify(bowl(200), 1700, SMALL)
    np.testing.assert_array_equal(densify(bowl(200), 1700, SMALL, core=200).points, whole.points)


def test_points_on_a_line_and_copies_are_no_trouble():
    line = np.outer(np.linspace(0, 1, 40), [1.0, 2.0, 3.0])
    new = densify(line, 160, SMALL).points
    assert np.linalg.norm(np.cross(new, [1, 2, 3]), axis=1).max() < 1e-9
    twice = np.repeat(bowl(40), 3, axis=0)
    assert np.isfinite(densify(twice, 500, SMALL).points).all()


@pytest.mark.dask
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_a_cluster_gives_the_same_points():
    distributed = pytest.importorskip("distributed")
    cloud = bowl(300)
    with (
        distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=":0") as cluster,
        worker_pool(scheduler=cluster.scheduler_address) as workers,
    ):
        other = densify(cloud, 900, SMALL, pool=workers).points
    np.testing.assert_array_equal(densify(cloud, 900, SMALL).points, other)


class Rated(Midpoints):
    """Interpolation whose predicted error of a point is its distance from the origin."""

    def __call__(self, points, touches, rate):
        made = super().__call__(points, touches, rate).points
        return Generated(made, np.linalg.norm(made, axis=1))


def test_new_points_have_the_errors_that_were_predicted_of_them():
    cloud = 7 * bowl(300) + 5
    new = densify(cloud, 900, Rated(size=512))
    rated = new.errors > 0
    assert rated.mean() > 0.9, "points in place of missing candidates have none"
    away = np.linalg.norm(new.points - OwnFrame.of(cloud).centre, axis=1)  # one patch holds the whole cloud
    np.testing.assert_allclose(new.errors[rated], away[rated], rtol=1e-6)


def test_errors_are_zero_where_none_is_predicted():
    assert not densify(bowl(100), 900, SMALL).errors.any()
    new = densify(bowl(300), 6000, Rated(size=512))
    assert len(new.errors) == len(new.points)
    assert 0.2 < (new.errors > 0).mean() < 1, "points of earlier passes have none"
