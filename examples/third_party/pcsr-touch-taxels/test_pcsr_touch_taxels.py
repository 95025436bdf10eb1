"""The touch source `taxels` keeps the contract of touch sources, and measures what its README says."""

import numpy as np
import pytest
import trimesh
from pcsr_touch_taxels import Taxels, lay_out

from pcsr import ShapeItem, UserError
from pcsr.geometry.rays import MeshRays
from pcsr.metrics import point_to_surface
from pcsr.testing import checks_for

CLOUD = np.zeros((0, 3))


@pytest.mark.parametrize("check", checks_for(Taxels), ids=str)
def test_part(check):
    check()


def ball(radius):
    return ShapeItem("ball", "ball", trimesh.creation.icosphere(subdivisions=5, radius=radius))


def test_taxels_lie_on_the_ball_about_a_pitch_apart():
    positions, area = lay_out(8.0, np.radians(60), 2.0)
    np.testing.assert_allclose(np.linalg.norm(positions - [0, 0, 8.0], axis=1), 8.0)
    assert positions[:, 2].max() <= 8.0 * (1 - np.cos(np.radians(60))) + 1e-9
    apart = np.linalg.norm(positions[:, None] - positions, axis=-1) + 9 * np.eye(len(positions))
    assert 1.5 < apart.min(1).min() <= apart.min(1).max() < 2.1
    # Together they stand for about the disc below the cap.
    assert area.sum() == pytest.approx(np.pi * (8.0 * np.sin(np.radians(60))) ** 2, rel=0.25)


def test_without_noise_the_points_lie_on_the_surface():
    source = Taxels(object_size=None, depth_noise=0.0)
    mesh = ball(30.0).mesh
    for touch in source.touches(ball(30.0), CLOUD, 5, 0):
        assert point_to_surface(touch.points, mesh.vertices, mesh.faces).max() < 1e-6


def test_on_a_plate_the_contact_is_as_wide_as_the_press_is_deep():
    plate = ShapeItem("plate", "plate", trimesh.creation.box(extents=(400, 400, 400)))
    source = Taxels(object_size=None, depth_noise=0.0, tilt=0.0, pitch=0.25, least=0.0, press=1.0, points=2000)
    (touch,) = source.touches(plate, CLOUD, 1, 3)
    # In the finger's frame the plate is 1 mm above the tip, where the ball of 8 mm is √(8² − 7²) mm wide.
    local = (touch.points - touch.poses[0, :3, 3]) @ touch.poses[0, :3, :3]
    np.testing.assert_allclose(local[:, 2], 1.0, atol=1e-6)
    assert np.linalg.norm(local[:, :2], axis=1).max() == pytest.approx(np.sqrt(8**2 - 7**2), abs=0.25)
    assert touch.contact_area == pytest.approx(np.pi * (8**2 - 7**2), rel=0.1)


def test_the_noise_moves_points_along_the_finger_alone():
    exact, noisy = (
        Taxels(depth_noise=noise, points=400, object_size=None).touches(ball(30.0), CLOUD, 1, 0)[0]
        for noise in (0.0, 0.1)
    )
    np.testing.assert_allclose(noisy.poses, exact.poses)
    frame = exact.poses[0, :3, :3]
    off = {tuple(np.round((point @ frame)[:2], 6)) for point in exact.points}
    assert {tuple(np.round((point @ frame)[:2], 6)) for point in noisy.points} == off
    assert not np.allclose(np.sort(noisy.points @ frame[:, 2]), np.sort(exact.points @ frame[:, 2]))


def test_the_object_is_as_large_as_it_is_said_to_be():
    (small,) = Taxels(object_size=60.0).touches(ball(0.03), CLOUD, 1, 0)
    assert small.unit == pytest.approx(1000, rel=1e-3)
    assert np.linalg.norm(small.points, axis=1) == pytest.approx(0.03, rel=0.05)


def test_every_touch_and_every_seed_has_a_place_of_its_own():
    source = Taxels()
    middles = [touch.points.mean(0) for seed in (0, 1) for touch in source.touches(ball(30.0), CLOUD, 4, seed)]
    assert len(np.unique(np.round(middles, 3), axis=0)) == 8


def test_a_finger_that_meets_nothing_tries_elsewhere(monkeypatch):
    looks, heights = [], MeshRays.heights

    def once_beside(rays, positions, axes):
        looks.append(len(positions))
        found = heights(rays, positions, axes)
        return found if len(looks) > 1 else np.full_like(found, -np.inf)

    monkeypatch.setattr(MeshRays, "heights", once_beside)
    (touch,) = Taxels().touches(ball(30.0), CLOUD, 1, 0)
    assert len(looks) == 2
    assert np.isfinite(touch.points).all()


def test_what_is_too_small_is_refused_by_name():
    with pytest.raises(UserError, match=r"ball: touch 'taxels' found 0 of 1 touches, .* raise object_size"):
        Taxels(object_size=1.0, at_least=9).touches(ball(1.0), CLOUD, 1, 0)


def test_a_press_that_nothing_feels_is_refused():
    with pytest.raises(UserError, match=r"press is 0\.1 mm, but a taxel measures 0\.1 mm or more: press deeper"):
        Taxels(press=0.1)
