import json
from dataclasses import replace

import numpy as np
import pytest

import pcsr
from pcsr import Touch, UserError, next_touches
from pcsr.clouds.formats import read_cloud
from pcsr.exploration.writing import as_json, write_next
from pcsr.recorded import read, write
from tests.exploration.scenes import TIP, ball, plane, upper

SEEN = upper(ball(900), above=1.0)


@pytest.fixture(scope="module")
def found():
    return next_touches(SEEN, sensor=TIP)


def test_poses_are_rigid_apart_and_in_order(found):
    assert len(found) == 5
    assert found.reason == ""
    for touch in found:
        np.testing.assert_allclose(touch.pose[:3, :3] @ touch.pose[:3, :3].T, np.eye(3), atol=1e-9)
        assert np.linalg.det(touch.pose[:3, :3]) == pytest.approx(1)
        assert 0 < touch.share <= 1
    at = np.array([touch.pose[:3, 3] for touch in found])
    apart = np.linalg.norm(at[:, None] - at[None], axis=-1)[np.triu_indices(5, 1)]
    assert apart.min() > 4
    assert found[0].gain == max(touch.gain for touch in found)


def test_the_first_is_on_the_hidden_side(found):
    assert found[0].guessed
    assert found[0].pose[2, 2] < -0.9  # it approaches upwards
    assert found[0].share > 0.3


def test_the_camera_says_which_side_is_hidden(found):
    above = next_touches(SEEN, sensor=TIP, count=1, camera=(0.0, 0.0, 100.0))
    assert above[0].guessed
    assert above[0].pose[2, 2] < -0.5
    metres = next_touches(SEEN / 1000, sensor=TIP, count=1, camera=(0.0, 0.0, 0.1), unit=1000.0)
    np.testing.assert_allclose(1000 * metres[0].pose[:3, 3], above[0].pose[:3, 3], atol=0.02)
    assert not any(touch.guessed for touch in next_touches(ball(600), sensor=TIP))


def test_nothing_is_guessed_of_a_cloud_from_all_around():
    found = next_touches(SEEN, sensor=TIP, count=3, all_around=True)
    assert len(found) > 0
    assert found.towards is None
    assert not any(touch.guessed for touch in found)


def test_the_face_rests_a_press_below_the_surface(found):
    seen = [touch for touch in found if not touch.guessed]
    for touch in seen:
        assert np.linalg.norm(touch.pose[:3, 3]) == pytest.approx(14, abs=0.7)


def test_the_unit_and_the_frame_do_not_matter(found):
    turned = np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]])
    metres = next_touches((SEEN + np.array([5000, 0, 0])) / 1000, sensor=TIP, unit=1000.0)
    for one, other in zip(found, metres, strict=True):
        np.testing.assert_allclose(one.pose[:3, 3] + [5000, 0, 0], 1000 * other.pose[:3, 3], atol=1e-3)
        np.testing.assert_allclose(one.pose[:3, :3], 1000 * other.pose[:3, :3], atol=1e-6)
        assert one.gain == pytest.approx(other.gain, rel=1e-6)
    assert next_touches(SEEN @ turned.T, sensor=TIP, count=1)[0].pose[0, 2] < -0.8


def test_the_same_arguments_give_the_same_poses(found):
    again = next_touches(SEEN, sensor=TIP, count=2)
    assert [np.array_equal(one.pose, other.pose) for one, other in zip(found, again, strict=False)] == [True, True]


def test_touches_are_not_repeated(found):
    lowest = np.array([0, 0, -15.0])
    patch = ball(20_000, seed=4)
    touch = Touch.single(patch[np.linalg.norm(patch - lowest, axis=1) < 7], None, 1.0, "digit")
    after = next_touches(SEEN, [touch], sensor=TIP, touch_as_is=True)
    assert all(np.linalg.norm(one.pose[:3, 3] - lowest) > 4 for one in after)
    assert after.error < found.error


def test_what_is_touched_everywhere_is_left():
    assert len(nothing := next_touches(SEEN, [ball(20_000)], sensor=TIP)) == 0
    assert nothing.reason == "the touches cover every surface that can be reached"


def test_a_cloud_without_room_for_the_sensor_gives_no_pose():
    rod = np.column_stack([np.random.default_rng(0).uniform(0, 13, 400), *(0.3 * ball(400)[:, :2].T / 15)])
    assert len(nothing := next_touches(rod, sensor=TIP)) == 0
    assert nothing.reason.startswith("none of 160 poses can be reached (")
    assert "with less contact than 17.5 mm²" in nothing.reason


def test_a_flat_sheet_has_poses_on_it():
    sheet = next_touches(plane(), sensor=TIP, count=2)
    assert len(sheet) == 2
    assert all(abs(touch.pose[2, 2]) > 0.99 and not touch.guessed for touch in sheet)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"cloud": SEEN / 1000}, r"0\.0298 mm long, smaller than the gel of sensor 'digit' \(16 × 12 mm\): .*--unit m"),
        ({"cloud": SEEN * 1e5}, r"far larger than the gel"),
        ({"cloud": SEEN[:10]}, "has 10 distinct points"),
        ({"count": 0}, "count is 0"),
        ({"unit": -1.0}, "unit is -1"),
        ({"camera": (0.0, 0.0)}, r"camera is \(0.0, 0.0\): give its position as three finite numbers"),
        ({"camera": (0.0, 0.0, np.nan)}, "three finite numbers"),
        ({"seed": -1}, "seed is -1"),
        ({"unit": "ell"}, "unit is 'ell': name it .m, cm, mm"),
        ({"sensor": "{a: 1}"}, "name a preset"),
        ({"cloud": np.outer(np.linspace(0, 40, 50), [1.0, 2, 3])}, "lie on a line"),
        ({"cloud": np.concatenate([SEEN, [[np.nan, 0, 0]]])}, "bad='drop'"),
        ({"camera": tuple(SEEN.mean(0))}, "inside of the cloud, which reaches from"),
        ({"camera": (0.0, 0.0, 100.0), "all_around": True}, "give either camera or all_around"),
        ({"sensor": "digitt"}, "did you mean 'digit'"),
        ({"policy": "spars"}, "did you mean 'sparse'"),
        ({"touches": [Touch.single(SEEN[:99], None, 1000.0, "x")], "unit": 1.0, "touch_as_is": True}, "1000 mm"),
    ],
)
def test_what_cannot_be_is_said(given, message):
    with pytest.raises(UserError, match=message):
        next_touches(**({"cloud": SEEN, "sensor": TIP} | given))


def test_gains_fall_and_leave_no_negative_error():
    for cloud, camera in ((SEEN, None), (SEEN, (0.0, 0.0, 90.0)), (upper(ball(900), above=-8.0), (0.0, 0.0, 90.0))):
        found = next_touches(cloud, sensor=TIP, count=6, camera=camera)
        gains = [touch.gain for touch in found]
        assert gains == sorted(gains, reverse=True)
        assert sum(gains) <= found.error + 1e-9


def test_the_error_depends_little_on_the_candidates():
    few, many = (next_touches(SEEN, sensor=TIP, count=1, candidates=number).error for number in (5, 320))
    assert few == pytest.approx(many, rel=0.3)


def test_the_assumed_direction_of_the_camera_is_told(found):
    assert found.towards[2] > 0.9
    assert next_touches(ball(600), sensor=TIP, count=1).towards is None
    far = next_touches(SEEN, sensor=TIP, count=1, camera=(1e300, 0.0, 0.0))
    np.testing.assert_allclose(far.towards, [1, 0, 0], atol=1e-12)
    assert as_json(found)["towards_camera"] == found.towards.tolist()


def test_units_have_names_and_faulty_points_can_be_left_out(found):
    named = next_touches(SEEN / 1000, sensor=TIP, count=1, unit="m")
    assert named.unit == 1000
    np.testing.assert_allclose(1000 * named[0].pose[:3, 3], found[0].pose[:3, 3], atol=1e-6)
    with pytest.warns(pcsr.PcsrWarning, match="not finite"):
        dropped = next_touches(np.concatenate([SEEN, [[np.nan, 0, 0]]]), sensor=TIP, count=1, bad="drop")
    np.testing.assert_allclose(dropped[0].pose, found[0].pose)


def scored(scores=lambda candidates: candidates.points[:, 2], error=lambda: None):
    class Given(pcsr.Policy):
        def scores(self, candidates, cloud, touched):
            return scores(candidates)

        def error(self, candidates, cloud, touched):
            return error()

    return Given()


def overwrite(candidates):
    candidates.points[:] = 0
    return np.zeros(len(candidates))


@pytest.mark.parametrize(
    ("policy", "message"),
    [
        (scored(error=lambda: np.nan), "policy Given expects an error of nan: return mm² from 0 on, or None"),
        (scored(error=lambda: -5.0), "expects an error of -5.0"),
        (scored(error=lambda: "x"), "expects an error of 'x'"),
        (scored(lambda candidates: [[1.0], [1.0, 2.0]]), "gave scores of shape"),
        (scored(lambda candidates: 1 / 0), "policy Given.scores failed: ZeroDivisionError: division by zero"),
        (scored(overwrite), "policy Given.scores failed: ValueError: assignment destination is read-only"),
    ],
)
def test_faulty_policies_are_named(policy, message):
    with pytest.raises(UserError, match=message):
        next_touches(SEEN, sensor=TIP, policy=policy, count=1)


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"gel": (np.nan, 12.0)}, "gel is"),
        ({"housing": (0.0, 18.0)}, "housing is"),
        ({"press": (1.5, 0.5)}, "the least depth in mm, then the greatest"),
        ({"protrusion": -1.0}, "protrusion is -1.0: give a number from 0 on"),
    ],
)
def test_impossible_fingertips_are_refused(changed, message):
    with pytest.raises(UserError, match=message):
        replace(TIP, **changed)


def test_a_policy_without_expectation_gives_no_gains():
    class Highest(pcsr.Policy):
        def scores(self, candidates, cloud, touched):
            return candidates.points[:, 2]

    (one,) = next_touches(SEEN, sensor=TIP, policy=Highest(), count=1)
    assert one.gain is one.share is None
    assert one.pose[2, 3] > 10


def test_json_is_what_recordings_and_ros_take(found, tmp_path):
    write_next(tmp_path / "next.json", found, "camera")
    content = json.loads((tmp_path / "next.json").read_text())
    first = content["touches"][0]
    assert first["gain_mm2"] == found[0].gain
    assert first["ros"]["header"]["frame_id"] == "camera"
    np.testing.assert_allclose(list(first["ros"]["pose"]["position"].values()), found[0].pose[:3, 3] / 1000)
    # Its poses are copied into a recording, which is read with them.
    write(tmp_path / "made", [Touch.single(SEEN[:50], None, 1.0, "digit")])
    manifest = json.loads((tmp_path / "made" / "touches.json").read_text())
    manifest["touches"][0]["pose"] = first["pose"]
    (tmp_path / "made" / "touches.json").write_text(json.dumps(manifest))
    (touch,) = read(tmp_path / "made").touches
    np.testing.assert_allclose(touch.poses[0], found[0].pose)


def test_ply_has_positions_normals_and_gains(found, tmp_path):
    write_next(tmp_path / "next.ply", found)
    cloud = read_cloud(tmp_path / "next.ply")
    np.testing.assert_allclose(cloud.points, [touch.pose[:3, 3] for touch in found])
    np.testing.assert_allclose(cloud.columns["gain_mm2"], [touch.gain for touch in found])
    np.testing.assert_allclose(cloud.columns["nz"], [touch.pose[2, 2] for touch in found])
    with pytest.raises(UserError, match=r"\.json or \.ply"):
        write_next(tmp_path / "next.txt", found)


def test_no_pose_is_written_too(tmp_path):
    nothing = next_touches(SEEN, [ball(20_000)], sensor=TIP)
    write_next(tmp_path / "a.json", nothing)
    assert json.loads((tmp_path / "a.json").read_text()) == as_json(nothing)
    assert as_json(nothing)["touches"] == []
    with pytest.raises(UserError, match="there is none: the touches cover"):
        write_next(tmp_path / "a.ply", nothing)
