"""`pcsr recorded import`, run as a person would run it: from a bag to a dense cloud, and what is wrong with bags."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.spatial.transform import Rotation

from pcsr import PoseError
from pcsr.cli import pcsr
from pcsr.clouds.formats import read_points
from pcsr.recorded import MANIFEST, read
from tests.recorded.bags import scene
from tests.ros.bags import KINDS, START, BagWriter


def run(*words):
    return CliRunner().invoke(pcsr, [str(word) for word in words])


def imported(bag, out, *more, topic="/gel/points", pose="gel", target="camera"):
    frame = [] if target is None else ["--object-frame", target]
    return run("recorded", "import", bag, "--touch", topic, "--pose", pose, *frame, "-o", out, *more)


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    return scene.write_scene(BagWriter(tmp_path_factory.mktemp("bags")))


@pytest.mark.parametrize("kind", KINDS)
def test_from_a_bag_to_a_dense_cloud(tmp_path, kind):
    bag = scene.write_scene(BagWriter(tmp_path, kind), kind="f8", pad=4)
    touches = tmp_path / "touches"
    done = imported(bag, touches, "--pose-error", "0.3,0.2", "--sensor", "digit")
    assert done.exit_code == 0, done.output
    rows = [line.split() for line in done.stdout.splitlines()]
    assert rows[2][:4] == ["3.000", "s", "160", "0.90"]
    assert rows[3][:4] == ["8.000", "s", "160", "1.20"]
    assert [float(number) for number in rows[2][4:7]] == pytest.approx(scene.gel_pose(3.0)[0], abs=2e-4)
    assert f"{touches}: 2 touches, in metres\n" in done.stdout
    assert f"next: pcsr upsample {bag}:/camera/points --touch {touches} -o dense.ply" in done.stdout
    recording = read(touches)
    assert (recording.names, recording.skipped) == (["3.000 s", "8.000 s"], {})
    assert recording.pose_error == PoseError(0.3, 0.2)
    for touch, direction in zip(recording.touches, scene.TOUCHED, strict=True):
        assert (touch.unit, touch.sensor, touch.contact_area) == (1000.0, "digit", None)
        assert scene.off_ball(touch.points) < 5e-6
        assert (touch.points.mean(0) - scene.CENTRE) @ direction > 0.95 * scene.BALL
        # pcsr's frame of a sensor has its origin on the face and looks along -z, in mm.
        np.testing.assert_allclose(touch.poses[0, :3, 2] * 1000, direction, atol=1e-4)
    dense = tmp_path / "dense.ply"
    made = run("upsample", f"{bag}:/camera/points", "--touch", touches, "-o", dense, "--model", "midpoint", "--jobs", 1)
    assert made.exit_code == 0, made.output
    assert "points and 2 of 2 touches to" in made.stderr
    points = read_points(dense)
    assert len(points) == 4 * len(scene.visible())
    assert scene.off_ball(points) < 2e-3


def test_poses_of_a_topic_are_those_of_tf(tmp_path, bag):
    assert imported(bag, tmp_path / "tf").exit_code == 0
    topic = imported(bag, tmp_path / "topic", pose="/gel_pose")
    assert topic.exit_code == 0, topic.output
    of_base = imported(bag, tmp_path / "base", pose="/gel_pose", target=None)
    assert of_base.exit_code == 0, of_base.output
    found = [read(tmp_path / name).touches for name in ("tf", "topic", "base")]
    for of_tf, of_topic, in_base in zip(*found, strict=True):
        np.testing.assert_allclose(of_topic.points, of_tf.points, atol=1e-5)
        np.testing.assert_allclose(scene.BASE[0] + scene.BASE[1].apply(in_base.points), of_topic.points, atol=1e-9)


def test_named_times_are_seconds_since_the_start_or_stamps(tmp_path, bag):
    done = imported(bag, tmp_path / "t", "--at", f"8.12,{START / 1e9 + 2.5:.3f},8.11")
    assert done.exit_code == 0, done.output
    assert read(tmp_path / "t").names == ["2.500 s", "8.100 s"]


def test_stamps_of_headers_are_the_times_that_count(tmp_path):
    """The sensor's messages are recorded half a second late."""
    with BagWriter(tmp_path) as bag:
        scene.write_poses(bag)
        for time in scene.times():
            points = np.concatenate([scene.contact(time), np.full((1, 3), np.nan)])
            bag.cloud("/gel/points", time + 0.5, points, frame="gel", stamp=START / 1e9 + time)
    assert imported(bag.path, tmp_path / "t").exit_code == 0
    recording = read(tmp_path / "t")
    assert recording.names == ["3.500 s", "8.500 s"]
    assert max(scene.off_ball(touch.points) for touch in recording.touches) < 5e-6


def test_bags_of_one_recording_are_read_together(tmp_path):
    poses, clouds = BagWriter(tmp_path, "sqlite3", "poses"), BagWriter(tmp_path, "mcap", "clouds")
    with poses, clouds:
        scene.write_poses(poses)
        for time in scene.times():
            clouds.cloud("/gel/points", time, np.append(scene.contact(time), [[9, 9, np.nan]], axis=0), frame="gel")
    words = ["--touch", "/gel/points", "--pose", "gel", "--object-frame", "camera", "-o", tmp_path / "t"]
    done = run("recorded", "import", poses.path, clouds.path, *words)
    assert done.exit_code == 0, done.output
    assert len(read(tmp_path / "t").touches) == 2
    assert "next: pcsr upsample SCAN --touch" in done.stdout


def test_axes_and_face_lead_from_the_frame_of_the_messages_to_the_gel(tmp_path):
    """The frame is a camera's, 22 mm behind the gel, x right, y down and z ahead."""
    camera = (np.array([0, 0, 0.022]), Rotation.from_euler("x", 180, degrees=True))
    with BagWriter(tmp_path) as bag:
        scene.write_poses(bag)
        bag.transform("optical", "gel", 0.0, camera[0], camera[1].as_quat(), static=True)
        for time in scene.times():
            points = scene.contact(time)
            points = camera[1].inv().apply(points - camera[0]) if len(points) else points
            bag.cloud("/gel/points", time, points, frame="gel", kind="f8")
    done = imported(bag.path, tmp_path / "t", "--axes", "+z", "--face", 22, pose="optical")
    assert done.exit_code == 0, done.output
    said = "/gel/points: its messages are in frame 'gel', and are taken as being in 'optical', the frame of --pose"
    assert said in done.stderr
    for touch, direction in zip(read(tmp_path / "t").touches, scene.TOUCHED, strict=True):
        assert scene.off_ball(touch.points) < 5e-6
        np.testing.assert_allclose(touch.poses[0, :3, 2] * 1000, direction, atol=1e-4)
        depths = (touch.points - touch.poses[0, :3, 3]) @ direction
        assert 0 < depths.min() < depths.max() < 2e-3
    wrong = imported(bag.path, tmp_path / "wrong", pose="optical")
    assert wrong.exit_code == 2
    assert "its points are 21.9 to 22 mm deep in the gel, more than any gel is thick: check --axes and" in wrong.stderr
    behind = imported(bag.path, tmp_path / "wrong", "--axes", "+z", pose="optical")
    assert behind.exit_code == 2
    said = (
        "no contact in its 220 messages: the gel is indented by 0 mm at most, and contacts by more than 0.1 mm: check -"
    )
    assert said in behind.stderr


def test_clouds_of_the_whole_gel_need_a_depth_of_contact(tmp_path):
    x, y = (axis.reshape(-1) for axis in np.meshgrid(*[np.linspace(-0.016, 0.016, 60)] * 2))
    with BagWriter(tmp_path) as bag:
        scene.write_poses(bag)
        for time in scene.times():
            height = np.sqrt(scene.BALL**2 - x**2 - y**2) - (scene.BALL - scene.pressed_mm(time)[0] / 1000)
            bag.cloud("/gel/points", time, np.stack([x, y, np.maximum(height, 0)], axis=1), frame="gel", kind="f8")
    done = imported(bag.path, tmp_path / "all")
    assert done.exit_code == 0, done.output
    assert "most points of the cloud at 3.000 s lie at the gel's face: if these are clouds of the whole" in done.stderr
    done = imported(bag.path, tmp_path / "touched", "--contact-above", 0.05)
    assert done.exit_code == 0, done.output
    assert "most points" not in done.stderr
    everything, touched = read(tmp_path / "all").touches, read(tmp_path / "touched").touches
    assert [len(touch.points) for touch in everything] == [3600, 3600]
    assert all(100 < len(touch.points) < 800 and scene.off_ball(touch.points) < 5e-6 for touch in touched)


def test_a_recording_is_replaced_only_if_asked(tmp_path, bag):
    assert imported(bag, tmp_path / "t", "--at", "3").exit_code == 0
    again = imported(bag, tmp_path / "t")
    assert (again.exit_code, read(tmp_path / "t").names) == (2, ["3.000 s"])
    assert "holds a recording already: choose another folder, or overwrite it (--overwrite)" in again.stderr
    assert imported(bag, tmp_path / "t", "--overwrite").exit_code == 0
    assert read(tmp_path / "t").names == ["3.000 s", "8.000 s"]


def test_contacts_without_a_pose_are_left_out_and_named(tmp_path):
    with BagWriter(tmp_path) as bag:
        for time in scene.times():
            if time < 6 or time > 9:
                bag.pose("/gel_pose", time, *(lambda p: (p[0], p[1].as_quat()))(scene.gel_pose(time)), frame="camera")
            bag.cloud("/gel/points", time, scene.contact(time), frame="gel")
    done = imported(bag.path, tmp_path / "t", pose="/gel_pose")
    assert done.exit_code == 0, done.output
    assert read(tmp_path / "t").names == ["3.000 s"]
    assert "the contact at 8.000 s is left out: frame 'gel_pose' has no transform within 0.1 s of 17000" in done.stderr
    named = imported(bag.path, tmp_path / "named", "--at", "3,8", pose="/gel_pose")
    assert named.exit_code == 2
    assert "/gel/points at 8.000 s: frame 'gel_pose' has no transform within 0.1 s" in named.stderr
    wide = imported(bag.path, tmp_path / "wide", "--max-gap", 3, pose="/gel_pose")
    assert wide.exit_code == 0, wide.output
    assert len(read(tmp_path / "wide").touches) == 2


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"topic": "/gel/point"}, "has no topic /gel/point: it has /camera/points (sensor_msgs/PointCloud2), /gel/"),
        (
            {"topic": "/tf"},
            "the topic /tf has messages tf2_msgs/TFMessage, not sensor_msgs/PointCloud2 or sensor_msgs/I",
        ),
        ({"pose": "gell"}, "there is no frame 'gell': the frames 'arm', 'base', 'camera', 'gel', 'tool'"),
        ({"pose": "/gell"}, "has no topic /gell: it has /camera/points"),
        (
            {"pose": "/camera/points"},
            "the topic /camera/points has messages sensor_msgs/PointCloud2, not geometry_msgs",
        ),
        (
            {"target": None},
            "--object-frame is missing: name the frame of the object or of its cloud: the frames 'arm', ",
        ),
        ({"target": "object"}, "there is no frame 'object': the frames"),
        (
            {"target": "/gel"},
            "--pose and --object-frame are both 'gel': name the frame of the sensor, and the frame in",
        ),
        ({"pose": "/gel_pose", "target": "object"}, "there is no frame 'object': the frames"),
    ],
)
def test_topics_and_frames_that_are_missing(tmp_path, bag, options, said):
    done = imported(bag, tmp_path / "t", **options)
    assert (done.exit_code, done.stderr.count("pcsr: error")) == (2, 1)
    assert said in done.stderr
    assert not (tmp_path / "t").exists()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--at", "99"], "--at 99: /gel/points has no message within 0.5 s: it has some from 0.000 to 10.950 s after"),
        (["--at", "-1"], "--at -1: /gel/points has no message within 0.5 s"),
        (["--at", "nan"], "--at nan: /gel/points has no message"),
        (["--at", "3;8"], "--at '3;8': it must be times in seconds, as in --at 3.2,7.85"),
        (["--at", "5.5"], "/gel/points at 5.500 s: no contact: no point is there"),
        (["--calibration", "x.json"], "--calibration: /gel/points has clouds, which take none: leave it out"),
        (["--background", "3"], "--background: /gel/points has clouds, which take none"),
        (["--camera-info", "/info"], "--camera-info: /gel/points has clouds, which take none"),
        (["--face", "nan"], "--face nan: it must be a number of millimetres"),
        (
            ["--face", "500"],
            "its points are 500 to 501 mm deep in the gel, more than any gel is thick: check --axes and",
        ),
        (
            ["--contact-above", "2"],
            "none of the 2 contacts can be used: the contact at 3.000 s is left out: no contact: n",
        ),
    ],
)
def test_options_that_do_not_fit(tmp_path, bag, more, said):
    done = imported(bag, tmp_path / "t", *more)
    assert (done.exit_code, done.stderr.count("pcsr: error")) == (2, 1)
    assert said in done.stderr
    assert not (tmp_path / "t").exists()


def small(folder, fill):
    """A bag of one contact cloud, with a fixed sensor, before which `fill` adds to it."""
    with BagWriter(folder) as bag:
        fill(bag)
        bag.cloud("/gel/points", 1.0, scene.contact(3.0), frame="gel")
    return bag.path


@pytest.mark.parametrize(
    ("fill", "said"),
    [
        (lambda bag: None, "has no topic /tf: it has /gel/points"),
        (lambda bag: bag.transform("gel", "tool", 1.0), "there is no frame 'camera': the frames 'gel', 'tool'"),
        (
            lambda bag: (bag.transform("gel", "tool", 1.0), bag.transform("camera", "base", 1.0)),
            "no transform leads from frame 'gel' to 'camera' but to the frames 'gel', 'tool'",
        ),
        (
            lambda bag: bag.transform("gel", "camera", 1.0, stamp=5.0),
            "frame 'gel' has no transform within 0.1 s of 1700000001.000 s: the nearest is 1.7e+09 s away, "
            "and all are from 5.000 to 5.000 s",
        ),
        (
            lambda bag: bag.transform("gel", "camera", 1.0, (np.nan, 0, 0)),
            "the transform from frame 'gel' to 'camera' is not finite",
        ),
        (
            lambda bag: bag.transform("gel", "camera", 1.0, (0, 0, 0), (0, 0, 1, 1)),
            "has the quaternion [0.0, 0.0, 1.0, 1.0], whose norm is 1.41421, not 1",
        ),
        (lambda bag: bag.add_topic("/tf", "tf2_msgs/msg/TFMessage"), "the topic /tf is empty: it has no messages"),
    ],
)
def test_transforms_that_cannot_be_used(tmp_path, fill, said):
    done = imported(small(tmp_path, fill), tmp_path / "t")
    assert done.exit_code == 2
    assert said in done.stderr
    assert not (tmp_path / "t").exists()


def test_a_fixed_sensor_needs_static_transforms_alone(tmp_path):
    bag = small(tmp_path, lambda bag: bag.transform("gel", "camera", 0.0, (0, 0, 1), static=True))
    done = imported(bag, tmp_path / "t")
    assert done.exit_code == 0, done.output
    expected = scene.contact(3.0) + np.array([0, 0, 1])
    np.testing.assert_allclose(read(tmp_path / "t").touches[0].points, expected, atol=1e-7)


def test_poses_that_are_equal_or_far_away_are_remarked(tmp_path, bag):
    done = imported(bag, tmp_path / "t", target="tool")
    assert done.exit_code == 0, done.output
    assert "all 2 touches have the same pose, as 'gel' does not move against 'tool': is the object at" in done.stderr
    assert "touches have the same pose" not in imported(bag, tmp_path / "u").stderr
    far = small(tmp_path, lambda bag: bag.transform("gel", "camera", 1.0, (400, 20, 300)))
    done = imported(far, tmp_path / "v")
    assert done.exit_code == 0, done.output
    assert "'gel' is up to 500.4 m from 'camera': are the poses in metres?" in done.stderr


def test_transforms_that_contradict_one_another_are_remarked(tmp_path):
    def fill(bag):
        for height in (0, 1):
            bag.transform("gel", "camera", 0.0, (0, 0, height), static=True)

    done = imported(small(tmp_path, fill), tmp_path / "t")
    assert done.exit_code == 0, done.output
    assert "frame 'gel' has several static transforms that differ: the last is used\n" in done.stderr


def test_points_far_beside_the_sensor_are_in_another_frame(tmp_path):
    with BagWriter(tmp_path) as bag:
        bag.transform("gel", "camera", 0.0, static=True)
        bag.cloud("/gel/points", 1.0, scene.contact(3.0) + np.array([0.2, 0, 0]), frame="gel")
    done = imported(bag.path, tmp_path / "t")
    assert done.exit_code == 2
    assert (
        "mm beside the axis of the sensor, and no gel is wider than 100 mm: check --pose and --axes, and" in done.stderr
    )


def test_odd_names_are_written_as_escapes(tmp_path):
    frame, topic = "g\n\x1b[31mel", "/[/red]\x1b[31m"
    with BagWriter(tmp_path) as bag:
        bag.transform(frame, "camera", 0.0, static=True)
        bag.cloud(topic, 1.0, scene.contact(3.0), frame="\x1b[32mx")
    done = imported(bag.path, tmp_path / "t", topic=topic, pose=frame)
    assert done.exit_code == 0, done.output
    assert "\x1b" not in done.output
    assert r"finding contacts in /[/red]\x1b[31m: 1 of 1" in done.stderr
    done = imported(bag.path, tmp_path / "u", topic=topic, pose="x")
    assert done.stderr.endswith(r"there is no frame 'x': the frames 'camera', 'g\n\x1b[31mel'" + "\n")


def test_a_bag_that_is_cut_off_and_a_missing_one(tmp_path, bag):
    (file,) = bag.glob("*.mcap")
    data = file.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(data[: len(data) // 2])
    for name, said in (("cut.mcap", "is cut off or damaged, or is no bag"), ("no.bag", "cannot be read: No such file")):
        done = imported(tmp_path / name, tmp_path / "t")
        assert (done.exit_code, said in done.stderr) == (2, True), done.output
    assert not (tmp_path / "t").exists()


@pytest.mark.parametrize("where", ["pcsr.recorded.folder.write_bytes", "pcsr.recorded.bags.importing.open_topic"])
def test_an_interruption_leaves_nothing(tmp_path, bag, monkeypatch, where):
    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(where, interrupted)
    done = imported(bag, tmp_path / "t")
    assert done.exit_code == 130
    assert not (tmp_path / "t").exists()


FACE, FX, CX, CY = 22.0, 240.0, 79.5, 59.5
PRESS = 1.4


def depth_image(press):
    """Depths in mm of a ball of 8 mm that is pressed onto a flat gel, seen by a camera behind it."""
    columns, rows = np.meshgrid(np.arange(160), np.arange(120))
    rays = np.stack([(columns - CX) / FX, (rows - CY) / FX, np.ones((120, 160))], axis=-1)
    centre = np.array([0.5, -0.3, FACE - press + 8])
    along, square = rays @ centre, (rays**2).sum(-1)
    inside = along**2 - square * (centre @ centre - 64)
    hit = np.where(inside > 0, (along - np.sqrt(np.maximum(inside, 0))) / square, np.inf)
    return np.minimum(hit, FACE), centre


def write_depths(bag, encoding, topic="/gel/depth/image"):
    pose = np.array([0.1, 0.2, 0.3]), Rotation.from_euler("xyz", [30, 40, 50], degrees=True)
    with bag:
        bag.transform("optical", "camera", 0.0, pose[0], pose[1].as_quat(), static=True)
        bag.camera_info("/gel/depth/camera_info", 0.0, FX, FX, CX, CY, (120, 160))
        for time in np.arange(0, 6, 0.1):
            depths = depth_image(max(0.0, PRESS - (time - 3) ** 2))[0]
            depths[:3, :3] = 0
            pixels = depths.round().astype("u2") if encoding == "16UC1" else (depths / 1000).astype("f4")
            bag.image(topic, time, pixels, encoding, frame="optical")
    return pose


@pytest.mark.parametrize(
    ("encoding", "background", "atol"), [("32FC1", None, 2e-6), ("32FC1", "0.2", 2e-6), ("16UC1", None, 1e-3)]
)
def test_depth_images(tmp_path, encoding, background, atol):
    bag = BagWriter(tmp_path)
    pose = write_depths(bag, encoding)
    more = [] if background is None else ["--background", background]
    options = {"topic": "/gel/depth/image", "pose": "optical"}
    done = imported(bag.path, tmp_path / "t", "--face", FACE, *more, **options)
    assert done.exit_code == 0, done.output
    recording = read(tmp_path / "t")
    assert (recording.names, recording.skipped) == (["3.000 s"], {})
    (touch,) = recording.touches
    in_camera = 1000 * pose[1].inv().apply(touch.points - pose[0])
    _, centre = depth_image(PRESS)
    np.testing.assert_allclose(np.linalg.norm(in_camera - centre, axis=1) / 1000, 0.008, atol=atol)
    assert f" {len(touch.points)} " in done.stdout
    assert touch.contact_area == pytest.approx(np.pi * (64 - (8 - 0.6 * PRESS) ** 2), rel=0.5 if atol > 1e-4 else 0.05)
    # The origin of pcsr's frame is on the face, and z leads to the camera.
    np.testing.assert_allclose(touch.poses[0, :3, 3], pose[0] + pose[1].apply([0, 0, FACE / 1000]), atol=1e-12)
    np.testing.assert_allclose(touch.poses[0, :3, 2] * 1000, pose[1].apply([0, 0, -1]), atol=1e-12)
    files = {path.name for path in (tmp_path / "t").iterdir()}
    assert files == {"0.npy", MANIFEST} | (set() if background is None else {"background.npy"})
    again = imported(bag.path, tmp_path / "t", "--face", FACE, "--overwrite", "--at", "3,2.9", **options)
    assert again.exit_code == 0, again.output
    assert {path.name for path in (tmp_path / "t").iterdir()} == {"0.npy", "1.npy", MANIFEST}


def test_a_background_in_a_file_and_a_depth_of_contact(tmp_path):
    bag = BagWriter(tmp_path)
    write_depths(bag, "32FC1")
    rest = np.full((120, 160), FACE / 1000)
    np.save(tmp_path / "rest.npy", rest)
    np.save(tmp_path / "small.npy", rest[1:])
    options = {"topic": "/gel/depth/image", "pose": "optical"}
    more = ["--face", FACE, "--contact-above", "0.1", "--background", tmp_path / "rest.npy"]
    done = imported(bag.path, tmp_path / "t", *more, **options)
    assert done.exit_code == 0, done.output
    (entry,) = json.loads((tmp_path / "t" / MANIFEST).read_text(encoding="utf-8"))["touches"]
    assert (entry["contact_above"], entry["background"]) == (0.1, "background.npy")
    assert read(tmp_path / "t").touches[0].contact_area == pytest.approx(np.pi * (64 - (8.1 - PRESS) ** 2), rel=0.1)
    done = imported(bag.path, tmp_path / "u", *more[:-1], tmp_path / "small.npy", **options)
    assert done.exit_code == 2
    assert "--background: it has (119, 160) rows and columns, and /gel/depth/image (120, 160)" in done.stderr


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ([], "--face is missing: /gel/depth/image has depth images: give the gel's distance from the camera in mm"),
        (["--face", 0], "--face is missing"),
        (
            ["--face", FACE, "--camera-info", "/tf_static"],
            "the topic /tf_static has messages tf2_msgs/TFMessage, not sens",
        ),
        (["--face", FACE, "--calibration", "x"], "--calibration: /gel/depth/image has depth images, which take none"),
        (["--face", FACE, "--background", "99"], "--background 99: /gel/depth/image has no message within 0.5 s"),
        (["--face", FACE, "--background", "no.npy"], "no.npy cannot be read"),
    ],
)
def test_options_that_do_not_fit_depth_images(tmp_path, more, said):
    bag = BagWriter(tmp_path)
    write_depths(bag, "32FC1")
    done = imported(bag.path, tmp_path / "t", *more, topic="/gel/depth/image", pose="optical")
    assert (done.exit_code, said in done.stderr) == (2, True), done.output
    assert not (tmp_path / "t").exists()


def test_intrinsics_of_another_place_are_named(tmp_path):
    bag = BagWriter(tmp_path)
    write_depths(bag, "32FC1", topic="/other/image")
    options = {"topic": "/other/image", "pose": "optical"}
    done = imported(bag.path, tmp_path / "t", "--face", FACE, **options)
    assert done.exit_code == 2
    assert "there is no topic /other/camera_info with the intrinsics of /other/image" in done.stderr
    assert "/gel/depth/camera_info (sensor_msgs/CameraInfo)" in done.stderr
    done = imported(bag.path, tmp_path / "t", "--face", FACE, "--camera-info", "/gel/depth/camera_info", **options)
    assert done.exit_code == 0, done.output


def test_images_of_other_encodings_are_refused(tmp_path):
    with BagWriter(tmp_path) as bag:
        bag.transform("gel", "camera", 0.0, static=True)
        bag.image("/gel/image", 0.0, np.zeros((4, 4, 4), np.uint8), "bgra8")
    done = imported(bag.path, tmp_path / "t", topic="/gel/image")
    assert done.exit_code == 2
    assert "/gel/image: its images have the encoding 'bgra8': 32FC1, 16UC1, rgb8, bgr8, PNG and JPEG are" in done.stderr
