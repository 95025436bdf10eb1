"""What a patch is filled with: on wires, beside stray points, between sheets, and on noisy surfaces."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from pcsr.upsample import densify
from pcsr.upsample.candidates import Generated, Midpoints
from pcsr.upsample.patch import BORDER, CELL, Task, _competing, _quotas, fill

SOURCE = Midpoints(size=256, rate=16)


def square(count, seed=0, side=1.0):
    return np.random.default_rng(seed).uniform(0, side, (count, 3)) * [1, 1, 0]


def test_stray_points_get_no_more_new_points_than_others():
    stray = np.random.default_rng(1).uniform([0, 0, 0.2], [1, 1, 2], (12, 3))
    cloud = np.concatenate([square(600), stray])
    nearest = cKDTree(cloud).query(densify(cloud, 4 * len(cloud), SOURCE).points)[1]
    assert (nearest >= 600).sum() / 12 <= 3


def test_normals_tell_the_sheets_of_a_plate_apart():
    side = np.sqrt(450)  # points are 1 apart
    above = np.array([0, 0, 1.4])
    sheets = np.concatenate([square(450, 0, side), square(450, 1, side) + above])
    normals = np.repeat([[0.0, 0, -1], [0, 0, 1]], 450, axis=0)

    def inside(**options):
        height = densify(sheets, 3600, SOURCE, **options).points[:, 2]
        return ((height > 0.28) & (height < 1.12)).mean()

    assert inside(normals=normals) < 0.01
    assert inside() > 0.05
    assert inside(normals=np.zeros_like(normals)) == inside(), "points without normals are as those of a cloud without"


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_a_cloud_may_have_a_few_normals_only(count):
    cloud, normals = square(100), np.zeros((100, 3))
    normals[:count, 2] = 1
    assert densify(cloud, 400, SOURCE, normals=normals).points.shape == (300, 3)


@pytest.mark.parametrize("rate", [4, 16])
def test_new_points_do_not_leave_a_wire(rate):
    rng = np.random.default_rng(0)
    angle = np.linspace(0, 20, 120) + rng.uniform(-0.04, 0.04, 120)  # half a step
    wire = np.column_stack([5 * np.cos(angle), 5 * np.sin(angle), 0.8 * angle])
    fine = np.linspace(0, 20, 20_000)
    curve = cKDTree(np.column_stack([5 * np.cos(fine), 5 * np.sin(fine), 0.8 * fine]))
    new = densify(wire, rate * 120, SOURCE).points
    assert np.median(curve.query(new)[0]) < 0.05
    assert (curve.query(new)[0] < 0.25).mean() > 0.97


def test_on_a_noisy_floor_new_points_are_closer_to_it_than_old_ones():
    cloud = square(900, side=30.0)
    cloud[:, 2] = np.random.default_rng(2).normal(0, 0.3, 900)
    new = densify(cloud, 3600, SOURCE).points
    assert np.abs(new[:, 2]).mean() < 0.6 * np.abs(cloud[:, 2]).mean()


class Touched(Midpoints):
    """Interpolation, and all touched points in single precision, as networks insert them."""

    def __call__(self, points, touches, rate):
        inserted = np.concatenate([np.zeros((0, 3)), *touches]).astype(np.float32).astype(np.float64)
        return Generated.of(np.concatenate([super().__call__(points, (), rate).points, inserted]))


def off(cloud, touch):
    """How far each touched point is from the nearest point of the dense cloud, in radii of the cloud."""
    source = Touched(size=256, rate=16)
    dense = densify(cloud, 4 * len(cloud), source, touches=[touch]).points
    return cKDTree(dense).query(touch)[0] / np.linalg.norm(cloud - cloud.mean(0), axis=1).max()


def test_touched_points_on_a_noisy_floor_are_not_moved():
    cloud = square(900, side=30.0)
    cloud[:, 2] = np.random.default_rng(2).normal(0, 0.3, 900)
    touch = np.array([[x, y, 0.6] for x in (6.0, 14.0, 22.0) for y in (5.0, 15.0, 25.0)])  # the farthest from all
    assert np.quantile(off(cloud, touch), 0.5) < 1e-6


def test_touched_points_beside_stray_points_are_not_too_many():
    strays = np.random.default_rng(1).uniform([0.2, 0.2, 0.5], [0.8, 0.8, 2], (6, 3))
    cloud = np.concatenate([square(250), strays])
    reach = cKDTree(cloud).query(strays, k=[4])[0][:, 0]
    touch = np.concatenate(
        [stray + 0.12 * reach[:, None][i] * np.vstack([np.eye(3), -np.eye(3)]) for i, stray in enumerate(strays)]
    )
    assert (off(cloud, touch) < 1e-6).mean() > 0.7


def test_touched_points_beside_a_wire_are_kept():
    angle = np.linspace(0, 20, 120)
    wire = np.column_stack([5 * np.cos(angle), 5 * np.sin(angle), 0.8 * angle])
    touch = wire[10:110:10] + np.array([0, 0, 0.5])  # within reach, and on no chord
    assert (off(wire, touch) < 1e-6).all()


def test_a_dense_half_of_a_patch_stays_as_much_denser():
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.uniform(0, 1, 200), rng.uniform(1, 2, 50)])
    cloud = np.column_stack([x, 2 * rng.uniform(0, 1, 250), np.zeros(250)])
    new = densify(cloud, 1000, SOURCE).points
    assert (new[:, 0] < 1).mean() == pytest.approx(0.8, abs=0.08)


@pytest.mark.parametrize("core", [60, 400])
def test_candidates_compete_at_points_of_the_core_and_those_next_to_it(core):
    cloud = square(400)[square(400)[:, 0].argsort()]
    competing = _competing(cloud, core, np.full(400, 0.05))
    away = np.linalg.norm(cloud[:, None] - cloud[:core], axis=2).min(1)
    np.testing.assert_array_equal(competing, away <= BORDER * 0.05)
    assert competing.sum() == 400 if core == 400 else core < competing.sum() < 200


class Corrected(Midpoints):
    """Interpolation, and a copy of each point in the plane z = 0, all of them with errors."""

    corrects_points = True

    def __call__(self, points, touches, rate):
        made = super().__call__(points, touches, rate).points
        return Generated(np.concatenate([points * [1, 1, 0], made * [1, 1, 0]]), np.full(len(points) + len(made), 0.1))


def test_copies_take_the_place_of_points_that_an_earlier_pass_generated():
    points = square(300)
    generated = square(300, seed=1) + np.array([0, 0, 0.02])
    every = np.concatenate([points, generated])
    fixed = np.arange(600) < 300
    for source, corrected in ((Corrected(size=600), True), (Midpoints(size=600), False)):
        task = Task(every, 600, fixed, np.zeros((600, 3)), [], 900, np.ones(600), 4)
        new = fill(source, task).points
        raw = cKDTree(new).query(generated)[0] < 1e-5
        assert raw.any() != corrected
        assert len(new) == 900


def test_each_cell_of_a_core_gets_its_share():
    rng = np.random.default_rng(0)
    core, weights = rng.normal(size=(700, 3)), rng.uniform(0.5, 2, 700)
    cell, quotas = _quotas(core, weights, 1000)
    assert quotas.sum() == 1000
    assert np.bincount(cell).max() <= CELL
    np.testing.assert_allclose(quotas, 1000 * np.bincount(cell, weights) / weights.sum(), atol=1)
