"""Noisy points come to the surface; clean ones, edges, stray points and wires stay."""

import numpy as np
import pytest
from scipy.stats import special_ortho_group

from pcsr.upsample.denoise import denoise
from pcsr.workers import worker_pool


def plane(count, noise, seed=0):
    """A square whose points are about 1 apart."""
    rng = np.random.default_rng(seed)
    across = rng.uniform(0, np.sqrt(count), (count, 2))
    return np.column_stack([across, noise * rng.normal(size=count)])


def ball(count, noise, seed=0, radius=10.0):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 3))
    points *= radius / np.linalg.norm(points, axis=1, keepdims=True)
    return points + noise * rng.normal(size=points.shape)


def box(count, noise, seed=0, half=8.0):
    rng = np.random.default_rng(seed)
    points = rng.uniform(-half, half, (count, 3))
    points[np.arange(count), rng.integers(0, 3, count)] = rng.choice([-half, half], count)
    return points + noise * rng.normal(size=points.shape)


def off_box(points, half=8.0):
    """The distance to the surface of the box."""
    beyond = np.abs(points) - half
    outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
    return np.where((beyond < 0).all(1), -beyond.max(1), outside)


@pytest.mark.parametrize("cloud", [plane(600, 0), ball(1000, 0), box(1000, 0)])
def test_clean_points_stay(cloud):
    result = denoise(cloud)
    assert (result.level, result.moved, result.mean) == (0, 0, 0)
    assert result.points is cloud


@pytest.mark.parametrize("noise", [0.1, 0.2, 0.4])
def test_a_noisy_plane_becomes_three_times_as_flat(noise):
    cloud = plane(900, noise)
    inner = ((cloud[:, :2] > 3) & (cloud[:, :2] < 27)).all(1)
    for level in (None, noise):
        height = denoise(cloud, level).points[inner, 2]
        assert height.std() < 0.33 * cloud[inner, 2].std()


def test_a_ball_gets_rounder_and_no_smaller():
    cloud = ball(1500, 0.2)
    radius = np.linalg.norm(denoise(cloud, 0.2).points, axis=1)
    assert np.abs(radius - 10).mean() < 0.4 * np.abs(np.linalg.norm(cloud, axis=1) - 10).mean()
    assert radius.mean() == pytest.approx(10, abs=0.02)


def test_edges_of_a_box_are_not_rounded():
    true, cloud = box(2000, 0), box(2000, 0.15)
    beside = np.sort(8 - np.abs(true), axis=1)[:, 1] < 1  # within a spacing of an edge
    moved = denoise(cloud, 0.15).points
    assert off_box(moved).mean() < 0.5 * off_box(cloud).mean()
    assert off_box(moved[beside]).mean() < 0.8 * off_box(cloud[beside]).mean()


def test_stray_points_stay_and_drag_no_others():
    cloud, strays = plane(900, 0.2), plane(20, 1, 1) * [5, 5, 1]
    strays[:, 2] = np.sign(strays[:, 2]) * (3 + np.abs(strays[:, 2]))
    moved = denoise(np.concatenate([cloud, strays]), 0.2).points
    np.testing.assert_allclose(moved[900:], strays, atol=0.05)
    assert moved[:900, 2].std() < 0.4 * cloud[:, 2].std()


def test_a_thin_wire_keeps_its_points():
    rng = np.random.default_rng(0)
    along = np.sort(rng.uniform(0, 200, 300))
    wire = np.column_stack([along, *(0.4 * np.array([np.cos(along * 7), np.sin(along * 7)]))])
    cloud = np.concatenate([plane(900, 0.1), wire + np.array([0, 0, 20])])
    assert np.linalg.norm(denoise(cloud, 0.1).points - cloud, axis=1)[900:].mean() < 0.1


def test_sheets_one_spacing_apart_are_not_merged():
    sheets = np.concatenate([plane(600, 0.05), plane(600, 0.05, 1) + np.array([0, 0, 1])])
    assert denoise(sheets).moved == 0
    height = denoise(sheets, 0.05).points[:, 2]
    assert ((height > 0.3) & (height < 0.7)).mean() < 0.01


@pytest.mark.parametrize("seed", range(3))
def test_the_frame_and_the_unit_do_not_matter(seed):
    cloud = box(700, 0.15)
    rng = np.random.default_rng(seed)
    turn, scale, shift = special_ortho_group.rvs(3, random_state=seed), 10.0 ** rng.uniform(-3, 3), rng.normal(size=3)
    moved = denoise(cloud)
    other = denoise(scale * (cloud @ turn.T + shift))
    assert other.level == pytest.approx(scale * moved.level, rel=1e-4)
    np.testing.assert_allclose(other.points, scale * (moved.points @ turn.T + shift), atol=1e-4 * scale)


def test_huge_and_tiny_units_are_no_problem():
    cloud = box(300, 0.2)
    expected = denoise(cloud, 0.2).points
    for unit in (1e-200, 1e200):
        np.testing.assert_allclose(denoise(cloud * unit, 0.2 * unit).points / unit, expected, atol=1e-4)


def test_the_order_of_points_does_not_matter():
    cloud = ball(1500, 0.2)
    order = np.random.default_rng(1).permutation(len(cloud))
    moved, other = denoise(cloud), denoise(cloud[order])
    np.testing.assert_allclose(other.points, moved.points[order], atol=1e-9)
    assert other.level == pytest.approx(moved.level, rel=1e-9)


@pytest.mark.slow
def test_processes_give_the_same_points():
    cloud = ball(2500, 0.2)
    with worker_pool(2) as pool:
        np.testing.assert_array_equal(denoise(cloud, pool=pool).points, denoise(cloud).points)


@pytest.mark.parametrize("count", [16, 17, 30])
def test_small_clouds_are_denoised_with_a_given_level(count):
    cloud = plane(count, 0.2)
    assert denoise(cloud).moved == 0
    assert np.isfinite(denoise(cloud, 0.2).points).all()


def test_progress_ends_at_its_total():
    calls = []
    denoise(ball(2500, 0.2), advance=lambda done, total: calls.append((done, total)))
    done, totals = zip(*calls, strict=True)
    assert done == tuple(range(1, totals[0] + 1))


def test_the_numbers_say_what_was_done():
    cloud = plane(900, 0.2)
    result = denoise(cloud, 0.2)
    distance = np.linalg.norm(result.points - cloud, axis=1)
    assert result.level == pytest.approx(0.2)
    assert result.moved == (distance > 1e-12).sum()
    assert result.mean == pytest.approx(distance[distance > 1e-12].mean())
