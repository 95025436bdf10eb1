import numpy as np
import pytest
import trimesh

from pcsr import Item, UserError
from pcsr.recipe.schema import options_model
from pcsr_plugins.touch.digit import Digit

CLOUD = np.zeros((1, 3))
IDEAL = {"object_size": None, "depth_noise": 0.0}
SHAPES = {
    "sphere": trimesh.creation.icosphere(subdivisions=4, radius=20),
    "box": trimesh.creation.box((60, 40, 30)),
    "cylinder": trimesh.creation.cylinder(radius=12, height=60),
    "torus": trimesh.creation.torus(30, 9, major_sections=80, minor_sections=40),
}


def touch(mesh, count=1, seed=0, **options):
    return Digit(**{**IDEAL, **options}).touches(Item("part-3", "part", mesh), CLOUD, count, seed)


def in_sensor(touch):
    """A touch's points in its sensor's frame, in mm."""
    inverse = np.linalg.inv(touch.pose)
    return touch.points @ inverse[:3, :3].T + inverse[:3, 3]


@pytest.mark.parametrize("name", SHAPES)
def test_points_lie_on_the_mesh_and_within_the_gel(name):
    mesh = SHAPES[name]
    for felt in touch(mesh, 4):
        assert felt.points.shape == (512, 3)
        _, distance, _ = trimesh.proximity.closest_point_naive(mesh, felt.points[::16])
        assert distance.max() < 1e-6 * mesh.extents.max()
        local = in_sensor(felt)
        assert np.abs(local[:, 0]).max() <= 8
        assert np.abs(local[:, 1]).max() <= 6.1
        # The sensor looks along -z: contact is what reaches above the gel's face, by at most the press.
        assert local[:, 2].min() > 0.05
        assert local[:, 2].max() <= 1.5
        assert 1000 * (16 / 121) ** 2 <= felt.contact_area <= 16 * 12.1


def test_a_flat_face_is_felt_by_the_whole_gel():
    slab = trimesh.creation.box((400, 400, 10))
    felt = touch(slab, tilt=0.0, press=(1.0, 1.0), seed=1)[0]
    sensor = Digit()
    assert felt.contact_area == pytest.approx(np.prod(sensor.shape) * sensor.pitch**2)
    np.testing.assert_allclose(in_sensor(felt)[:, 2], 1.0, atol=1e-6)
    assert felt.pose[2, 2] * np.sign(felt.points[0, 2]) == pytest.approx(1)  # z points out of the object


@pytest.mark.parametrize("press", [0.5, 1.0])
@pytest.mark.parametrize("radius", [15.0, 40.0])
def test_a_sphere_is_felt_in_a_disc(radius, press):
    ball = trimesh.creation.icosphere(subdivisions=6, radius=radius)
    felt = touch(ball, tilt=0.0, press=(press, press), at_least=512, width=24.0, height=24.0, pixels=200)[0]
    disc = np.sqrt(radius**2 - (radius - 0.8 * press) ** 2)
    assert felt.contact_area == pytest.approx(np.pi * disc**2, rel=0.03)
    assert np.linalg.norm(in_sensor(felt)[:, :2], axis=1).max() == pytest.approx(disc, rel=0.03)


def test_a_domed_gel_feels_a_flat_face_in_an_ellipse():
    slab = trimesh.creation.box((400, 400, 10))
    felt = touch(slab, tilt=0.0, press=(0.5, 0.5), dome=(50.0, 23.0))[0]
    semi_axes = np.sqrt(2 * 0.4 * np.array([50, 23]))
    assert semi_axes[0] < 8
    assert felt.contact_area == pytest.approx(np.pi * semi_axes.prod(), rel=0.02)
    np.testing.assert_allclose(np.abs(in_sensor(felt)[:, :2]).max(0), semi_axes, rtol=0.05)
    np.testing.assert_allclose(in_sensor(felt)[:, 2], 0.5, atol=1e-6)


def test_fewer_touches_are_a_prefix_of_more():
    many, few = touch(SHAPES["torus"], 4, seed=7), touch(SHAPES["torus"], 2, seed=7)
    for a, b in zip(many, few, strict=False):
        assert np.array_equal(a.points, b.points)
        assert np.array_equal(a.pose, b.pose)
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
        assert b.scale == pytest.approx(factor * 60 / 90)


def test_an_object_far_from_the_origin_is_touched_alike():
    far = SHAPES["box"].copy().apply_translation([5000, 0, -300])
    felt = touch(far)[0]
    back = felt.points - np.array([5000, 0, -300])
    np.testing.assert_allclose(back, touch(SHAPES["box"])[0].points, atol=1e-6)


def test_noise_moves_only_what_it_is_said_to_move():
    ideal = touch(SHAPES["torus"])[0]
    rough = touch(SHAPES["torus"], depth_noise=0.05)[0]
    shift = in_sensor(rough) - in_sensor(ideal)
    assert np.abs(shift[:, :2]).max() < 1e-9
    assert shift[:, 2].std() == pytest.approx(0.05, rel=0.15)
    moved = touch(SHAPES["torus"], position_noise=0.5, rotation_noise=1.0)[0]
    np.testing.assert_allclose(in_sensor(moved), in_sensor(ideal), atol=1e-9)
    error = np.linalg.inv(ideal.pose) @ moved.pose
    assert 0.05 < np.linalg.norm(error[:3, 3]) < 2
    assert 0.1 < np.degrees(np.arccos((np.trace(error[:3, :3]) - 1) / 2)) < 4


def test_the_tilt_stays_within_twice_its_deviation():
    ball = trimesh.creation.icosphere(subdivisions=4, radius=50)
    poses = np.array([felt.pose for felt in touch(ball, 40, tilt=4.0)])
    # On a sphere the normal at a place is the direction to it; the gel's centre lies over the place.
    axes, places = poses[:, :3, 2], poses[:, :3, 3]
    angles = np.degrees(np.arccos((axes * places).sum(1) / np.linalg.norm(places, axis=1)))
    assert angles.max() < 8 + 2.0  # the facets' own normals differ from the sphere's by less than two degrees
    assert angles.max() > 4


def test_too_small_a_contact_is_no_touch():
    needle = trimesh.creation.cylinder(radius=0.2, height=60)
    with pytest.raises(UserError, match=r"part-3: touch 'digit' found 0 of 2 touches.* at 60 mm .*raise object_size"):
        touch(needle, 2)
    assert touch(needle, 2, at_least=10, points=10)


def test_the_housing_never_enters_the_object(monkeypatch):
    slot = trimesh.creation.box((200, 42, 60), trimesh.transformations.translation_matrix([0, 0, 30]))
    channel = trimesh.boolean.difference([trimesh.creation.box((100, 48, 40)), slot])
    housing = np.random.default_rng(0).uniform([-13.5, -9, 2.0], [13.5, 9, 40], (2000, 3))

    def inside(felt):
        return channel.contains(housing @ felt.pose[:3, :3].T + felt.pose[:3, 3]).any()

    touches = touch(channel, 40)
    assert not any(inside(felt) for felt in touches)
    assert any((np.abs(felt.points[:, 2]) < 1e-6).all() for felt in touches), "the slot is wide enough to get in"
    monkeypatch.setattr("pcsr_plugins.touch.digit.PROTRUSION", np.inf)
    assert any(inside(felt) for felt in touch(channel, 40))


def test_turned_faces_and_holes_do_no_harm():
    prism = trimesh.creation.cylinder(radius=40, height=80, sections=3)
    prism.invert()
    touches = touch(prism, 8, tilt=0.0, press=(1.0, 1.0))
    assert any(abs(felt.pose[2, 2]) < 0.1 for felt in touches), "its sides are most of its surface"
    for felt in touches:
        np.testing.assert_allclose(in_sensor(felt)[:, 2], 1.0, atol=1e-4)  # flat on a face, from outside
        assert (felt.pose[:3, 2] * felt.points.mean(0)).sum() > 0
    sheet = trimesh.Trimesh([[0, 0, 0], [60, 0, 0], [60, 60, 0], [0, 60, 0]], [[0, 1, 2], [0, 2, 3]])
    assert np.abs(touch(sheet, 2)[1].points[:, 2]).max() < 1e-6
    inner = trimesh.creation.box((20, 20, 20))
    inner.invert()
    hollow = trimesh.util.concatenate([SHAPES["box"], inner])
    for felt in touch(hollow, 10):
        on_outside = np.abs(np.abs(felt.points) - [30, 20, 15]).min(1)
        assert on_outside.max() < 1e-5


def test_options_that_contradict_each_other_are_said():
    with pytest.raises(UserError, match="at_least is 100, fewer than the 512 points kept"):
        Digit(at_least=100)
    with pytest.raises(UserError, match="give the least depth first"):
        Digit(press=(1.0, 0.5))


def test_no_touches_is_none():
    assert touch(SHAPES["box"], 0) == []


@pytest.mark.parametrize("wrong", ['{"width": 0}', '{"press": [0, 1]}', '{"dome": [50]}', '{"tilt": -1}'])
def test_a_recipe_gives_the_options_and_is_told_of_impossible_ones(wrong):
    model = options_model(Digit)
    given = model.model_validate_json('{"object_size": 320, "press": [1, 2], "dome": [50, 23]}')
    sensor = Digit(**given.model_dump())
    assert (sensor.object_size, sensor.press, sensor.tilt) == (320.0, (1.0, 2.0), 5.0)
    with pytest.raises(ValueError, match=wrong.split('"')[1]):
        model.model_validate_json(wrong)


def test_only_the_part_of_the_contact_with_the_deepest_point_is_felt():
    bars = [
        trimesh.creation.box((60, 5, 20), trimesh.transformations.translation_matrix([0, y, 0])) for y in (-4.0, 4.0)
    ]
    across = 0
    for felt in touch(trimesh.util.concatenate(bars), 20, tilt=0.0):
        assert (felt.points[:, 1] < 0).all() or (felt.points[:, 1] > 0).all()
        corners = np.array([[x, y, 0, 1] for x in (-8, 8) for y in (-6, 6)]) @ felt.pose.T
        across += abs(felt.pose[2, 2]) > 0.9 and corners[:, 1].min() < -4 and corners[:, 1].max() > 4
    assert across > 0
