import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial import cKDTree

from pcsr import UserError
from pcsr.geometry.sampling import farthest_points, poisson_points, poisson_subset, surface_points


def generator(seed=0):
    return np.random.default_rng(seed)


def gaps(points):
    return cKDTree(points).query(points, k=2)[0][:, 1]


def hexagonal(area, count):
    """The spacing of the densest packing of `count` points on a flat area."""
    return np.sqrt(2 * area / (np.sqrt(3) * count))


def farthest_slowly(points, count, start):
    chosen = [start]
    while len(chosen) < count:
        distance = np.linalg.norm(points[:, None] - points[chosen], axis=2).min(1)
        distance[chosen] = -1
        chosen.append(int(distance.argmax()))
    return chosen


def test_surface_points_lie_on_the_surface():
    points = surface_points(trimesh.creation.box((2, 2, 2)), 500, generator())
    assert np.allclose(np.abs(points).max(1), 1)


def test_surface_points_fall_by_area():
    # One triangle has nine times the area of the other; its own mean is its centroid.
    corners = np.array([[0, 0, 0], [3, 0, 0], [0, 3, 0], [0, 0, 9], [1, 0, 9], [0, 1, 9]], float)
    mesh = trimesh.Trimesh(corners, [[0, 1, 2], [3, 4, 5]], process=False)
    points = surface_points(mesh, 20_000, generator())
    large = points[points[:, 2] == 0]
    assert len(large) / 20_000 == pytest.approx(0.9, abs=0.01)
    assert large.mean(0) == pytest.approx([1, 1, 0], abs=0.03)


def test_a_mesh_without_area_is_refused():
    flat = trimesh.Trimesh(np.zeros((3, 3)), [[0, 1, 2]], process=False)
    with pytest.raises(UserError, match="1 triangles of area 0 in all"):
        surface_points(flat, 10, generator())


def test_poisson_points_are_spread_evenly_over_the_surface():
    sphere = trimesh.creation.icosphere(4)
    even, random = poisson_points(sphere, 2000, generator()), surface_points(sphere, 2000, generator())
    ideal = hexagonal(sphere.area, 2000)
    assert even.shape == (2000, 3)
    assert np.abs(np.linalg.norm(even, axis=1) - 1).max() < 0.01
    assert gaps(even).min() > 0.6 * ideal
    assert gaps(random).min() < 0.1 * ideal


@pytest.mark.parametrize("draw", [surface_points, poisson_points])
def test_points_depend_on_the_seed_alone(draw):
    box = trimesh.creation.box()
    assert np.array_equal(draw(box, 100, generator(1)), draw(box, 100, generator(1)))
    assert not np.array_equal(draw(box, 100, generator(1)), draw(box, 100, generator(2)))


def test_a_poisson_subset_of_an_uneven_cloud_evens_it_out():
    rng = generator()
    cloud = np.concatenate([rng.normal(size=(1000, 3)) * 0.01, rng.random((1000, 3))])
    kept = cloud[poisson_subset(cloud, 100, rng)]
    assert gaps(kept).min() > 3 * gaps(cloud[rng.choice(2000, 100, replace=False)]).min()
    assert gaps(kept).min() > 0.5 * gaps(cloud[farthest_points(cloud, 100)]).min()


@given(st.integers(1, 40), st.integers(0, 40), st.integers(1, 5), st.integers(0, 99))
@settings(max_examples=60, deadline=None)
def test_a_poisson_subset_has_exactly_as_many_points_whatever_coincides(n, count, repeats, seed):
    cloud = np.repeat(generator(seed).integers(0, 3, (n, 3)).astype(float), repeats, axis=0)
    count = min(count, len(cloud))
    kept = poisson_subset(cloud, count, generator(seed))
    assert len(kept) == count == len(np.unique(kept))


@given(arrays(np.float64, (25, 3), elements=st.integers(-3, 3).map(float)), st.integers(1, 25))
@settings(max_examples=60, deadline=None)
def test_farthest_points_agree_with_looking_at_every_distance(points, count):
    points += 0.1 * generator().random(points.shape)  # no ties, which would have several right answers
    assert farthest_points(points, count, start=3).tolist() == farthest_slowly(points, count, 3)
    first = int(np.linalg.norm(points - points.mean(0), axis=1).argmax())
    assert farthest_points(points, count).tolist() == farthest_slowly(points, count, first)


@given(arrays(np.float64, (30, 3), elements=st.integers(0, 2).map(float)), st.integers(1, 30), st.randoms())
@settings(max_examples=60, deadline=None)
def test_farthest_points_do_not_depend_on_the_order_even_where_distances_tie(points, count, random):
    order = random.sample(range(30), 30)
    ours, shuffled = points[farthest_points(points, count)], points[order]
    assert np.array_equal(ours, shuffled[farthest_points(shuffled, count)])


def test_farthest_points_of_coinciding_points_are_all_chosen_once():
    assert sorted(farthest_points(np.ones((9, 3), np.float32), 9)) == list(range(9))


def test_farthest_points_tell_neighbours_apart_in_coordinates_of_millions():
    points = generator().random((50, 3))
    assert np.array_equal(farthest_points(points + 5e6, 20), farthest_points(points, 20))


@pytest.mark.parametrize("thin", [farthest_points, lambda points, count: poisson_subset(points, count, generator())])
def test_more_points_than_there_are_is_refused(thin):
    with pytest.raises(UserError, match="8 points were asked of a cloud of 7"):
        thin(np.zeros((7, 3)), 8)


def test_a_start_outside_the_cloud_is_refused():
    with pytest.raises(UserError, match="start at point 7 of a cloud of 7"):
        farthest_points(np.zeros((7, 3)), 2, start=7)
