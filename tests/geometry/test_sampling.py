import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from pcsr import UserError
from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.sampling import poisson_points, poisson_subset, surface_points


def generator(seed=0):
    return np.random.default_rng(seed)


def gaps(points):
    return cKDTree(points).query(points, k=2)[0][:, 1]


def hexagonal(area, count):
    """The spacing of the densest packing of `count` points on a flat area."""
    return np.sqrt(2 * area / (np.sqrt(3) * count))


def thinned_slowly(points, count, rng):
    """Darts one after another, in the order of their ranks, with one radius after another."""
    n, rank = len(points), rng.permutation(len(points))
    distance = np.linalg.norm(points[:, None] - points, axis=2)
    k = min(n // count, 16)
    low, high = 0.0, np.inf
    radius = 1.4 * np.median(np.sort(distance)[:, k]) * (n / count / k) ** 0.5
    while True:
        kept = []
        for point in np.argsort(rank):
            if not kept or distance[point, kept].min() > radius:
                kept.append(int(point))
        if len(kept) < count:
            high = radius
        elif len(kept) <= 1.005 * count:
            return kept[:count]
        else:
            low = radius
        guess = radius * (len(kept) / (1.0025 * count)) ** 0.5
        radius = guess if low < guess < high else (low + high) / 2


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


@pytest.mark.parametrize(("n", "count"), [(600, 60), (600, 400), (1500, 300)])
@pytest.mark.parametrize("seed", range(4))
def test_a_poisson_subset_is_that_of_darts_one_after_another(n, count, seed):
    cloud = generator(seed).random((n, 3)) * [1, 1, 0]
    cloud[: n // 10, 2] = 1  # some are sparse
    ours = poisson_subset(cloud, count, generator(seed))
    assert ours.tolist() == thinned_slowly(cloud, count, generator(seed))


def test_more_points_than_there_are_is_refused():
    with pytest.raises(UserError, match="8 points were asked of a cloud of 7"):
        poisson_subset(np.zeros((7, 3)), 8, generator())
