import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from pcsr.geometry.rays import MeshRays
from pcsr_plugins.shapes.cad_parts import CadParts
from pcsr_plugins.touch.digit import sensors
from pcsr_plugins.touch.digit.candidates import Candidates
from pcsr_plugins.touch.digit.press import Finger

SLAB = MeshRays(trimesh.creation.box((200, 200, 20)), None, "slab")
TOP = np.array([3.0, -5.0, 10.0])


def leaning(degrees):
    return Rotation.from_euler("zx", [40, degrees], degrees=True).as_matrix()


def in_ray_frame(contact):
    points = contact.points(contact.seen[..., 2])
    return points @ contact.pose[:3, :3].T + contact.pose[:3, 3]


@pytest.mark.parametrize("name", sensors.names())
@pytest.mark.parametrize("degrees", [0.0, 4.0])
def test_a_plane_is_met_where_the_rays_of_a_pinhole_or_of_the_sun_meet_it(name, degrees):
    sensor, frame = sensors.load(name), leaning(degrees)
    contact = Finger(sensor).press(SLAB, TOP, frame, 1.0)
    columns, rows = sensor.pixels
    normal = frame.T @ [0, 0, 1.0]  # in the sensor's frame
    offset = normal @ (frame.T @ (TOP - contact.pose[:3, 3]))
    for row, column in ((0, 0), (rows // 2, 3), (rows - 1, columns - 1)):
        x, y = (column - (columns - 1) / 2) * sensor.pitch, (row - (rows - 1) / 2) * sensor.pitch
        if sensor.projection == "orthographic":
            start, direction = np.array([x, y, 0]), np.array([0, 0, 1.0])
        else:
            start = np.array([0, 0, sensor.distance])
            direction = np.array([x, y, 0]) - start
        met = start + (offset - normal @ start) / (normal @ direction) * direction
        np.testing.assert_allclose(contact.seen[row, column], met, atol=1e-9)


@pytest.mark.parametrize(("name", "side"), [("smith-2020", 16.41), ("smith-2021", 9.3174)])
def test_a_rigid_face_lies_flat_on_a_flat_face_and_sees_all_of_it(name, side):
    contact = Finger(sensors.load(name)).press(SLAB, TOP, leaning(0.0), 1.0)
    assert contact.mask.all()
    assert contact.area == pytest.approx(side**2, rel=1e-4)
    assert np.abs(contact.seen[..., 2]).max() < 1e-9
    np.testing.assert_allclose(in_ray_frame(contact)[:, 2], 10.0, atol=1e-9)


def test_a_camera_covers_more_the_farther_it_sees():
    smith = sensors.load("smith-2021", housing=(9.4, 9.4))
    pit = trimesh.util.concatenate(
        [
            trimesh.creation.box((100, 100, 2)),
            trimesh.creation.box((1, 100, 8), trimesh.transformations.translation_matrix([-4.5, 0, 3])),
        ]
    )
    contact = Finger(smith).press(MeshRays(pit, None, "pit"), np.array([0, 0, 4.0]), np.eye(3), 1.0)
    floor = contact.mask & (np.abs(contact.seen[..., 2] + 6) < 1e-6)
    wall = contact.mask & (np.abs(contact.seen[..., 2]) < 1e-6)
    assert floor.sum() > 10_000 > wall.sum() > 1000
    areas = (smith.pitch * (12.8 + 6) / 12.8) ** 2 * floor.sum() + smith.pitch**2 * wall.sum()
    between = int(contact.mask.sum() - floor.sum() - wall.sum())
    assert areas <= contact.area <= areas + between * (smith.pitch * 18.8 / 12.8) ** 2
    widest = np.abs(contact.points(contact.seen[..., 2])[:, 1]).max()
    assert widest == pytest.approx(smith.height / 2 * 18.8 / 12.8, rel=0.02)


def test_what_is_out_of_reach_is_not_felt():
    short = sensors.load("smith-2020", reach=3.0)
    ball = MeshRays(trimesh.creation.icosphere(subdivisions=5, radius=12), None, "ball")
    contact = Finger(short).press(ball, np.array([0, 0, 12.0]), np.eye(3), 1.0)
    # A sphere is 3 mm below its top at this distance from the axis.
    assert contact.area == pytest.approx(np.pi * (12**2 - 9**2), rel=0.01)
    assert contact.seen[..., 2][contact.mask].min() == pytest.approx(-3, abs=0.05)
    assert contact.seen[..., 2][contact.mask].max() <= 1e-6


def test_the_housing_of_a_rigid_face_stops_it_and_that_of_a_gel_refuses():
    step = trimesh.util.concatenate(
        [
            trimesh.creation.box((100, 100, 2)),
            trimesh.creation.box((2, 100, 8), trimesh.transformations.translation_matrix([11, 0, 4])),
        ]
    )
    rays = MeshRays(step, None, "step")
    at = np.array([0.0, 0, 0])
    contact = Finger(sensors.load("smith-2020")).press(rays, at, np.eye(3), 1.0)
    assert contact.seen[..., 2].max() == pytest.approx(-7)  # the step stands 7 mm above the floor
    assert Finger(sensors.load("digit")).press(rays, at, np.eye(3), 1.0) is None
    assert Finger(sensors.load("digit", protrusion=8.0)).press(rays, at, np.eye(3), 1.0).mask.all()


def test_nothing_met_is_no_contact():
    assert Finger(sensors.load("digit")).press(SLAB, np.array([500.0, 0, 0]), np.eye(3), 1.0) is None
    assert Finger(sensors.load("smith-2021")).press(SLAB, np.array([500.0, 0, 0]), np.eye(3), 1.0) is None


def test_what_parallel_rays_miss_is_not_pressed_deeper_than_the_press(monkeypatch):
    # Spikes between the pixels of a coarse camera.
    cone = trimesh.creation.cone(radius=30, height=25, sections=64)
    rays = MeshRays(cone, None, "cone")
    finger = Finger(sensors.load("digit-tacto", pixels=24, dome="flat", protrusion=20.0))
    tops = np.random.default_rng(0).uniform(-4, 4, (40, 3)) * [1, 1, 0] + [0, 0, 15]

    def deepest():
        seen = [finger.press(rays, top, np.eye(3), 1.0) for top in tops]
        assert all(contact.mask.any() for contact in seen)
        assert max(contact.seen[..., 2][contact.mask].max() for contact in seen) <= 1 + 1e-6
        return max(contact.seen[..., 2].max() for contact in seen)

    assert deepest() < 1.001
    monkeypatch.setattr("pcsr_plugins.touch.digit.press.CASTS", 1)
    assert deepest() > 1.01, "without looking again it would be"


def test_points_move_along_their_rays():
    for name in ("digit", "digit-tacto"):
        sensor = sensors.load(name)
        contact = Finger(sensor).press(SLAB, TOP, leaning(2.0), 1.0)
        still, moved = contact.points(contact.seen[..., 2]), contact.points(contact.seen[..., 2] + 0.3)
        np.testing.assert_allclose(still, contact.seen[contact.mask], atol=1e-12)
        np.testing.assert_allclose(moved[:, 2], still[:, 2] + 0.3)
        rays = still - ([0, 0, sensor.distance] if sensor.distance else still * [1, 1, 0] + [0, 0, 100])
        assert np.abs(np.cross(moved - still, rays)).max() < 1e-9


def test_a_quick_look_before_the_rays_changes_nothing(monkeypatch):
    rejected = looked = 0
    for name in ("test/hook/0000", "test/bolt/0000"):
        rays = MeshRays(CadParts().item(name).mesh, 60.0, name)
        (positions,) = Candidates.draw(rays, 20, 5.0, (0.5, 1.5), [np.random.default_rng(0)])
        for sensor in (sensors.load("digit"), sensors.load("digit-tacto")):
            finger = Finger(sensor)
            at = [
                (rays, *one) for one in zip(positions.points, positions.frames, positions.presses.tolist(), strict=True)
            ]
            quick = [finger.press(*one) for one in at]
            with monkeypatch.context() as patch:
                patch.setattr("pcsr_plugins.touch.digit.visible_pixels.FACES", 0)
                slow = [finger.press(*one) for one in at]
            for a, b in zip(quick, slow, strict=True):
                assert (a is None) == (b is None)
                if a is not None:
                    assert np.array_equal(a.mask, b.mask)
                    assert np.array_equal(a.pose, b.pose)
                    assert np.array_equal(a.seen[a.mask], b.seen[b.mask])
            rejected += sum(a is None for a in quick)
            looked += sum(a is not None for a in quick)
    assert rejected > 10
    assert looked > 10
