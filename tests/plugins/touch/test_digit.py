"""The touch source `digit`: touches lie on the mesh, within the gel, and follow from the seed."""

import itertools

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from pcsr import UserError
from pcsr.recipe.schema import options_model
from pcsr_plugins.shapes.cad_parts import CadParts
from pcsr_plugins.touch.digit import Digit, hand, sensors
from tests.plugins.touch.plain_options import digit
from tests.plugins.touch.touching import SHAPES, in_sensor, touch


def test_touches_do_not_depend_on_how_many_places_are_looked_at_together(monkeypatch):
    whole = touch(SHAPES["torus"], 5)
    for together in (1, 200):
        monkeypatch.setattr(hand, "AT_ONCE", together)
        for one, other in zip(touch(SHAPES["torus"], 5), whole, strict=True):
            assert np.array_equal(one.points, other.points)
            assert np.array_equal(one.poses, other.poses)


@pytest.mark.parametrize("name", SHAPES)
def test_points_lie_on_the_mesh_and_within_the_gel(name):
    mesh = SHAPES[name]
    for touched in touch(mesh, 4):
        assert touched.points.shape == (512, 3)
        _, distance, _ = trimesh.proximity.closest_point_naive(mesh, touched.points[::16])
        assert distance.max() < 1e-6 * mesh.extents.max()
        local = in_sensor(touched)
        assert np.abs(local[:, 0]).max() <= 8
        assert np.abs(local[:, 1]).max() <= 6.1
        # The sensor looks along -z: contact is what reaches above the gel's face, by 0.4 of the press to all of it.
        assert local[:, 2].min() > 0.4 * 0.5
        assert local[:, 2].max() <= 1.5
        assert 1000 * (16 / 121) ** 2 <= touched.contact_area <= 16 * 12.1


def test_a_flat_face_is_felt_by_the_whole_gel():
    slab = trimesh.creation.box((400, 400, 10))
    touched = touch(slab, tilt=0.0, press=(1.0, 1.0), seed=1)[0]
    assert touched.contact_area == pytest.approx(121 * 91 * (16 / 121) ** 2)
    np.testing.assert_allclose(in_sensor(touched)[:, 2], 1.0, atol=1e-6)
    assert touched.poses[0][2, 2] * np.sign(touched.points[0, 2]) == pytest.approx(1)  # z points out of the object


@pytest.mark.parametrize("press", [0.5, 1.0])
@pytest.mark.parametrize("radius", [15.0, 40.0])
def test_a_sphere_is_felt_in_a_disc(radius, press):
    ball = trimesh.creation.icosphere(subdivisions=6, radius=radius)
    touched = touch(ball, tilt=0.0, press=(press, press), at_least=512, width=24.0, height=24.0, pixels=200)[0]
    disc = np.sqrt(radius**2 - (radius - 0.6 * press) ** 2)
    assert touched.contact_area == pytest.approx(np.pi * disc**2, rel=0.03)
    assert np.linalg.norm(in_sensor(touched)[:, :2], axis=1).max() == pytest.approx(disc, rel=0.03)


def test_a_domed_gel_feels_a_flat_face_in_an_ellipse():
    slab = trimesh.creation.box((400, 400, 10))
    touched = touch(slab, tilt=0.0, press=(0.5, 0.5), dome=(50.0, 23.0))[0]
    semi_axes = np.sqrt(2 * 0.6 * 0.5 * np.array([50, 23]))
    assert semi_axes[0] < 8
    assert touched.contact_area == pytest.approx(np.pi * semi_axes.prod(), rel=0.02)
    np.testing.assert_allclose(np.abs(in_sensor(touched)[:, :2]).max(0), semi_axes, rtol=0.05)
    np.testing.assert_allclose(in_sensor(touched)[:, 2], 0.5, atol=1e-6)


def test_fewer_touches_are_a_prefix_of_more():
    many, few = touch(SHAPES["torus"], 4, seed=7), touch(SHAPES["torus"], 2, seed=7)
    for a, b in zip(many, few, strict=False):
        assert np.array_equal(a.points, b.points)
        assert np.array_equal(a.poses, b.poses)
    assert not np.array_equal(many[0].points, many[1].points)
    assert not np.array_equal(many[0].points, touch(SHAPES["torus"], 1, seed=8)[0].points)


@pytest.mark.parametrize("factor", [1e-3, 25.4])
def test_the_unit_of_the_mesh_does_not_matter(factor):
    options = {"object_size": 90.0, "depth_noise": 0.02}
    plain = touch(SHAPES["cylinder"], 2, **options)
    moved = SHAPES["cylinder"].copy().apply_scale(factor)
    for a, b in zip(plain, touch(moved, 2, **options), strict=True):
        np.testing.assert_allclose(b.points, a.points * factor, atol=1e-6 * 60 * factor)
        assert b.contact_area == pytest.approx(a.contact_area)
        assert a.unit == pytest.approx(90 / 60)
        assert b.unit == pytest.approx(90 / 60 / factor)


def test_an_object_far_from_the_origin_is_touched_alike():
    far = SHAPES["box"].copy().apply_translation([5000, 0, -300])
    touched = touch(far)[0]
    back = touched.points - np.array([5000, 0, -300])
    np.testing.assert_allclose(back, touch(SHAPES["box"])[0].points, atol=1e-6)


def test_noise_moves_only_what_it_is_said_to_move():
    ideal = touch(SHAPES["torus"])[0]
    rough = touch(SHAPES["torus"], depth_noise=0.05)[0]
    shift = in_sensor(rough) - in_sensor(ideal)
    assert np.abs(shift[:, :2]).max() < 1e-9
    assert shift[:, 2].std() == pytest.approx(0.05, rel=0.15)
    pose_noise = {"position_noise": 0.5, "rotation_noise": 1.0}
    moved = touch(SHAPES["torus"], **pose_noise)[0]
    np.testing.assert_allclose(in_sensor(moved), in_sensor(ideal), atol=1e-9)
    pairs = zip(touch(SHAPES["torus"], 30), touch(SHAPES["torus"], 30, **pose_noise), strict=True)
    errors = np.array([np.linalg.inv(ideal.poses[0]) @ moved.poses[0] for ideal, moved in pairs])
    assert errors[:, :3, 3].std() == pytest.approx(0.5, rel=0.25)
    turned = Rotation.from_matrix(errors[:, :3, :3]).as_rotvec(degrees=True)
    assert turned.std() == pytest.approx(1.0, rel=0.25)


SHARED = {"noise": {"shared_position_noise": 1.0, "shared_rotation_noise": 2.0}}


def _motion(before, after):
    """The rigid motion between the poses of two touches, in the object's frame."""
    return after.poses[0] @ np.linalg.inv(before.poses[0])


@pytest.mark.parametrize("private", [{}, {"position_noise": 0.5, "rotation_noise": 1.0}])
@pytest.mark.parametrize("policy", ["sparse", "grasp"])
def test_a_shared_error_moves_all_touches_of_an_object_alike(private, policy):
    shape = SHAPES["box"].copy().apply_translation([300.0, 0.0, -50.0])
    before = touch(shape, 3, policy=policy, **private)
    after = touch(shape, 3, policy=policy, **private, **SHARED)
    first = _motion(before[0], after[0])
    np.testing.assert_allclose(first[:3, :3] @ first[:3, :3].T, np.eye(3), atol=1e-9)
    assert not np.allclose(first, np.eye(4), atol=1e-3)
    for one, other in zip(before, after, strict=True):
        np.testing.assert_allclose(other.points, one.points @ first[:3, :3].T + first[:3, 3], atol=1e-8)
        np.testing.assert_allclose(other.poses, first @ one.poses, atol=1e-8)
        assert (other.contact_area, other.finger.tolist()) == (one.contact_area, one.finger.tolist())


def test_a_shared_error_depends_on_the_object_alone():
    alone, several = (touch(SHAPES["box"], count, **SHARED)[0] for count in (1, 4))
    assert np.array_equal(alone.points, several.points)
    motions = [_motion(touch(SHAPES["box"], seed=k)[0], touch(SHAPES["box"], seed=k, **SHARED)[0]) for k in range(2)]
    assert not np.allclose(*motions)


def test_a_shared_error_has_its_deviation_about_the_middle_of_the_object_in_millimetres():
    noise = digit(**SHARED).hand.noise
    errors = np.array([noise.shared_error(np.random.default_rng(k)) for k in range(300)])
    assert errors[:, :3, 3].std() == pytest.approx(1.0, rel=0.1)
    turned = Rotation.from_matrix(errors[:, :3, :3]).as_rotvec(degrees=True)
    assert turned.std() == pytest.approx(2.0, rel=0.1)
    # A box of 0.06 that is taken to be 60 mm long: its middle moves by the position error alone, in metres.
    metres = SHAPES["box"].copy().apply_scale(0.001).apply_translation([2.0, 0.0, 0.0])
    motion = _motion(*(touch(metres, object_size=60.0, **more)[0] for more in ({}, SHARED)))
    in_mm = _motion(touch(SHAPES["box"])[0], touch(SHAPES["box"], **SHARED)[0])
    moved = motion[:3, :3] @ np.array([2.0, 0.0, 0.0]) + motion[:3, 3] - np.array([2.0, 0.0, 0.0])
    np.testing.assert_allclose(moved * 1000, in_mm[:3, 3], atol=1e-9)


def test_the_tilt_stays_within_twice_its_deviation():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=50)
    poses = np.concatenate([touched.poses for touched in touch(ball, 40, tilt=4.0)])
    # On a sphere the normal at a place is the direction to it; the gel's centre lies over the place.
    axes, candidates = poses[:, :3, 2], poses[:, :3, 3]
    angles = np.degrees(np.arccos((axes * candidates).sum(1) / np.linalg.norm(candidates, axis=1)))
    assert angles.max() < 8 + 2.0  # the facets' own normals differ from the sphere's by less than two degrees
    assert angles.max() > 4


def test_too_small_a_contact_is_no_touch():
    needle = trimesh.creation.cylinder(radius=0.2, height=60)
    with pytest.raises(UserError, match=r"part-3: touch 'digit' found 0 of 2 touches, .* at 60 mm .*raise object_size"):
        touch(needle, 2)
    (touched,) = touch(needle, at_least=10)
    assert len(np.unique(touched.points, axis=0)) < 512 == len(touched.points)  # repeated where there are fewer


def test_the_housing_never_enters_the_object():
    slot = trimesh.creation.box((200, 42, 60), trimesh.transformations.translation_matrix([0, 0, 30]))
    channel = trimesh.boolean.difference([trimesh.creation.box((100, 48, 40)), slot])
    housing = np.random.default_rng(0).uniform([-13.5, -9, 2.0], [13.5, 9, 40], (2000, 3))

    def inside(touched):
        return channel.contains(housing @ touched.poses[0, :3, :3].T + touched.poses[0, :3, 3]).any()

    touches = touch(channel, 40)
    assert not any(inside(touched) for touched in touches)
    assert any((np.abs(touched.points[:, 2]) < 1e-6).all() for touched in touches), "the slot is wide enough to get in"
    assert any(inside(touched) for touched in touch(channel, 40, protrusion=1000.0))


def test_turned_faces_and_holes_do_no_harm():
    prism = trimesh.creation.cylinder(radius=40, height=80, sections=3)
    prism.invert()
    touches = touch(prism, 8, tilt=0.0, press=(1.0, 1.0))
    assert any(abs(touched.poses[0, 2, 2]) < 0.1 for touched in touches), "its sides are most of its surface"
    for touched in touches:
        np.testing.assert_allclose(in_sensor(touched)[:, 2], 1.0, atol=1e-4)  # flat on a face, from outside
        assert (touched.poses[0, :3, 2] * touched.points.mean(0)).sum() > 0
    sheet = trimesh.Trimesh([[0, 0, 0], [60, 0, 0], [60, 60, 0], [0, 60, 0]], [[0, 1, 2], [0, 2, 3]])
    assert np.abs(touch(sheet, 2)[1].points[:, 2]).max() < 1e-6
    inner = trimesh.creation.box((20, 20, 20))
    inner.invert()
    hollow = trimesh.util.concatenate([SHAPES["box"], inner])
    for touched in touch(hollow, 10):
        on_outside = np.abs(np.abs(touched.points) - [30, 20, 15]).min(1)
        assert on_outside.max() < 1e-5


def test_options_that_contradict_each_other_are_said():
    with pytest.raises(UserError, match="give the least depth first"):
        Digit(press=(1.0, 0.5))
    with pytest.raises(UserError, match=r"press is \(0.01, 0.04\), but contact begins at 0.05 mm"):
        Digit(press=(0.01, 0.04))


def test_no_touches_is_none():
    assert touch(SHAPES["box"], 0) == []


@pytest.mark.parametrize(
    "wrong",
    [
        '{"sensor": {"width": 0}}',
        '{"press": [0, 1]}',
        '{"sensor": {"dome": [50]}}',
        '{"tilt": -1}',
        '{"sensor": "digt"}',
        '{"sensor": {"fov": 180}}',
        '{"sensor": {"dome": "round"}}',
        '{"noise": {"blur": -1}}',
        '{"policy": {"tries": 0}}',
    ],
)
def test_a_recipe_gives_the_options_and_is_told_of_impossible_ones(wrong):
    model = options_model(Digit)
    sensor = digit(object_size=320, press=[1, 2], sensor={"dome": [50, 23]})
    assert (sensor.object_size, sensor.hand.press, sensor.hand.tilt) == (320.0, (1.0, 2.0), 5.0)
    with pytest.raises(ValueError, match=wrong.split('"')[1]):
        model.model_validate_json(wrong)


def test_only_the_part_of_the_contact_with_the_deepest_point_is_felt():
    bars = [
        trimesh.creation.box((60, 5, 20), trimesh.transformations.translation_matrix([0, y, 0])) for y in (-4.0, 4.0)
    ]
    across = 0
    for touched in touch(trimesh.util.concatenate(bars), 20, tilt=0.0):
        assert (touched.points[:, 1] < 0).all() or (touched.points[:, 1] > 0).all()
        corners = np.array([[x, y, 0, 1] for x in (-8, 8) for y in (-6, 6)]) @ touched.poses[0].T
        across += abs(touched.poses[0, 2, 2]) > 0.9 and corners[:, 1].min() < -4 and corners[:, 1].max() > 4
    assert across > 0


PART = CadParts().item("test/valve/0000").mesh
EVERY_SHAPE = {**SHAPES, "part": PART}


@pytest.mark.parametrize("shape", ["sphere", "box", "torus", "part"])
@pytest.mark.parametrize("name", sensors.names())
def test_every_sensor_without_noise_feels_the_mesh_itself(name, shape):
    mesh, sensor = EVERY_SHAPE[shape], sensors.load(name)
    for touched in touch(mesh, 2, sensor=name, press=(0.6, 0.9), seed=1):
        _, distance, _ = trimesh.proximity.closest_point_naive(mesh, touched.points[::8])
        assert distance.max() < 1e-6 * mesh.extents.max()
        local = in_sensor(touched)
        near, far = local[:, 2].min(), local[:, 2].max()
        assert touched.sensor == name
        wider = 1 if sensor.distance is None else 1 - local[:, 2] / sensor.distance
        half = np.array([sensor.width, sensor.height]) / 2
        # Pixels are square: the last row may stand out by half a pixel.
        beyond = np.abs(local[:, :2]).T - half[:, None] * wider
        assert beyond.max() <= sensor.pitch / 2
        if sensor.senses == "pressure":
            sag = 0 if sensor.dome is None else (local[:, :2] ** 2 / (2 * np.array(sensor.dome))).sum(1)
            assert near > 0.12
            assert (local[:, 2] - sag).max() <= 0.9 + 1e-6
        else:
            assert near >= -sensor.reach
            assert far <= 1e-6


def test_a_figure_of_ones_own_is_said_in_the_sensors_name():
    changed = touch(SHAPES["box"], sensor={"width": 20.0, "pixels": 200})[0]
    assert changed.sensor == "digit (changed)"
    assert np.abs(in_sensor(changed)[:, 0]).max() > 8


def test_an_area_does_not_depend_on_the_pixels_but_a_count_does():
    coarse = {"sensor": {"pixels": 40}, "tilt": 0.0}
    with pytest.raises(UserError, match="lower at_least or"):
        touch(SHAPES["sphere"], **coarse)
    plain = touch(SHAPES["sphere"], at_least_area=17.5, tilt=0.0)[0]
    few = touch(SHAPES["sphere"], at_least_area=17.5, **coarse)[0]
    assert few.contact_area == pytest.approx(plain.contact_area, rel=0.03)
    with pytest.raises(UserError, match=r"less contact than 190 mm².*lower at_least_area"):
        touch(SHAPES["sphere"], at_least_area=190.0, policy={"tries": 10})


def test_a_surface_that_nothing_can_reach_is_refused_with_the_reasons():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=15)
    bars = []
    for axis in range(3):
        for along, side in itertools.product(np.arange(-28, 29, 4), (-28, 28)):
            bar, at = np.full(3, 0.4), np.zeros(3)
            bar[axis], at[(axis + 1) % 3], at[(axis + 2) % 3] = 60, along, side
            bars.append(trimesh.creation.box(bar, trimesh.transformations.translation_matrix(at)))
    cage = trimesh.util.concatenate([ball, *bars])
    reasons = r"\d+ behind other parts of the object, \d+ without room .*, \d+ with less contact than 30 mm²"
    with pytest.raises(
        UserError, match=rf"part-3: .* 0 of 1 touches, then none of 100 candidates would do \({reasons}\)"
    ):
        touch(cage, at_least_area=30.0)
    assert touch(ball, at_least_area=30.0)


@pytest.mark.parametrize(
    ("mesh", "reason"),
    [
        (trimesh.Trimesh(np.zeros((3, 3)), [[0, 1, 2]], process=False), "no area"),
        (trimesh.Trimesh([[0, 0, 0], [90, 0, 0], [0, np.inf, 0]], [[0, 1, 2]], process=False), "not finite"),
        (trimesh.Trimesh(), "no faces"),
        (trimesh.creation.box((0.06, 0.05, 0.04)), r"0.06 mm long, smaller than the gel .*16 × 12 mm.*in metres"),
    ],
)
def test_a_mesh_that_is_not_a_thing_is_named(mesh, reason):
    with pytest.raises(UserError, match=f"part-3.*{reason}"):
        touch(mesh)


def test_an_object_made_smaller_than_the_gel_is_told_the_option():
    with pytest.raises(UserError, match=r"part-3 is 11 mm long, .*: raise object_size$"):
        touch(SHAPES["box"], object_size=11.0)
    assert touch(SHAPES["box"], object_size=12.0, at_least=100)
