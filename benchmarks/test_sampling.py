"""Farthest points, 65,536 to 8,192, and as many blue-noise points of a surface, on one core.

make bench ARGS=benchmarks/test_sampling.py
"""

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import cKDTree

from pcsr.geometry.farthest import farthest_points
from pcsr.geometry.sampling import CANDIDATES, poisson_points, surface_points
from pcsr_plugins.shapes.cad_parts import CadParts

MANY, COUNT = 65_536, 8_192
FARTHEST = f"farthest points, {MANY:,} to {COUNT:,}"
POISSON = f"{COUNT:,} blue-noise points of a cad-part"


@pytest.fixture(scope="module")
def mesh():
    shapes = CadParts()
    return shapes.item(shapes.names("train")[0]).mesh


@pytest.fixture(scope="module")
def cloud(mesh):
    return surface_points(mesh, MANY, np.random.default_rng(0)).astype(np.float32)


def test_farthest_points(benchmark, line, cloud):
    line(FARTHEST, "ours", "≥ 20 × a torch loop")
    assert len(np.unique(benchmark(farthest_points, cloud, COUNT, 0))) == COUNT


def test_farthest_points_by_a_torch_loop(benchmark, line, cloud):
    """The loop of PointNet++ for one cloud: all distances to the last point, and the farthest of the nearest."""
    line(FARTHEST, "usual")
    points = torch.from_numpy(cloud)

    def usual():
        chosen = torch.zeros(COUNT, dtype=torch.long)
        distance = torch.full((MANY,), torch.inf)
        farthest = torch.tensor(0)
        for i in range(COUNT):
            chosen[i] = farthest
            distance = torch.minimum(distance, ((points - points[farthest]) ** 2).sum(-1))
            farthest = distance.argmax()
        return chosen

    chosen = benchmark.pedantic(usual, rounds=1)
    same = (chosen.numpy() == farthest_points(cloud, COUNT, 0)).mean()
    benchmark.extra_info["says"] = f"{same:.2%} the same indices at the same positions"


def test_the_distances_that_farthest_points_need(benchmark, line, cloud):
    """Each point to the nearest chosen one, once, when all are known: to choose them that is needed too."""
    line(FARTHEST, "limit")
    chosen = cloud[farthest_points(cloud, COUNT, 0)]
    benchmark(lambda: cKDTree(chosen).query(cloud))


def test_poisson_points(benchmark, line, mesh):
    line(POISSON, "ours", "halved, or at its limit")
    points = benchmark(lambda: poisson_points(mesh, COUNT, np.random.default_rng(0)))
    benchmark.extra_info["says"] = f"ours: {describe(points, mesh)}"


def test_poisson_points_by_darts_one_after_another(benchmark, line, mesh):
    """Random points of the surface, each kept if none that was kept is near, as in trimesh; the rest is cut off."""
    line(POISSON, "usual")

    def usual():
        candidates, _ = trimesh.sample.sample_surface(mesh, CANDIDATES * COUNT, seed=0)
        radius = (mesh.area / COUNT / 2) ** 0.5
        points = np.zeros((0, 3))
        while len(points) < COUNT:  # a radius that leaves enough is found by trying
            near = cKDTree(candidates).query_ball_point(candidates, radius)
            free, kept = np.ones(len(candidates), bool), []
            for point, others in enumerate(near):
                if free[point]:
                    kept.append(point)
                    free[others] = False
            points, radius = candidates[kept], 0.98 * radius
        return points[:COUNT]

    points = benchmark.pedantic(usual, rounds=3)
    benchmark.extra_info["says"] = f"usual: {describe(points, mesh)}"


def test_the_pairs_that_poisson_points_need(benchmark, line, mesh):
    """The candidates, and one look at which of them are too near to each other at the radius that was found."""
    line(POISSON, "limit")
    points = poisson_points(mesh, COUNT, np.random.default_rng(0))
    radius = cKDTree(points).query(points, k=2)[0][:, 1].min()

    def limit():
        candidates = surface_points(mesh, CANDIDATES * COUNT, np.random.default_rng(0))
        cKDTree(candidates, balanced_tree=False).query_pairs(radius, output_type="ndarray")

    benchmark(limit)


def describe(points, mesh):
    """How even it is: the least distance, as a share of that in the densest packing of a flat area."""
    ideal = (2 * mesh.area / (3**0.5 * len(points))) ** 0.5
    return f"{len(points)} points, {cKDTree(points).query(points, k=2)[0][:, 1].min() / ideal:.2f} of the ideal spacing"
