"""`pcsr recorded import` of images in colour, with a calibration and a background."""

import json
from io import BytesIO

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from scipy.spatial.transform import Rotation

from pcsr.cli import pcsr
from pcsr.recorded import MANIFEST, read
from pcsr.sensors import Calibration, PressImage, ball_indentation, calibrate, gel, read_rgb, shaded
from tests.ros.bags import BagWriter

SIZE, MM_PER_PIXEL, DIAMETER, PRESS = (120, 160), 0.1, 8.0, 0.8
CENTRE = (90.0, 50.0)
"""Column and row of the ball."""
POSE = np.array([0.1, 0.2, 0.3]), Rotation.from_euler("xyz", [30, 40, 50], degrees=True)
"""Pose of the camera's optical frame, which is at the face of the gel here."""


def picture(depth, seed, diameter=DIAMETER, centre=CENTRE):
    rng = np.random.default_rng(seed)
    if depth <= 0:
        return shaded(np.zeros(SIZE), MM_PER_PIXEL, rng)
    return shaded(ball_indentation(SIZE, MM_PER_PIXEL, diameter, depth, centre), MM_PER_PIXEL, rng)


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    places = [(column, row) for column in (40.0, 80.0, 120.0) for row in (35.0, 85.0)]
    presses = [PressImage(f"{place}", picture(0.7, i, 6.0, place), 6.0) for i, place in enumerate(places)]
    made = calibrate(presses, picture(0, 9), mm_per_pixel=MM_PER_PIXEL, sensor="my-sensor", gel=gel("my-sensor"))
    path = tmp_path_factory.mktemp("calibration") / "my-sensor.json"
    made.calibration.save(path)
    return path


def encoded(pixels):
    content = BytesIO()
    Image.fromarray(pixels).save(content, "PNG")
    return content.getvalue()


def recorded(folder, kind="rgb8", *, black=()):
    """A bag with one press, at 3 seconds; some of its images are black."""
    with BagWriter(folder) as bag:
        bag.transform("gel", "camera", 0.0, POSE[0], POSE[1].as_quat(), static=True)
        for number in range(50):
            time = number / 10
            pixels = picture(PRESS - (time - 3) ** 2, number)
            pixels = np.zeros_like(pixels) if number in black else pixels
            if kind == "png":
                bag.compressed("/gel/image", time, encoded(pixels), "png", frame="gel")
            else:
                bag.image("/gel/image", time, pixels[:, :, ::-1] if kind == "bgr8" else pixels, kind, frame="gel")
    return bag.path


def imported(bag, out, *more):
    words = ["recorded", "import", bag, "--touch", "/gel/image", "--pose", "gel", "--object-frame", "camera", "-o", out]
    return CliRunner().invoke(pcsr, [str(word) for word in [*words, *more]])


@pytest.mark.parametrize("kind", ["rgb8", "bgr8", "png"])
def test_images_in_colour_become_entries_with_calibration_and_background(tmp_path, calibration, kind):
    done = imported(recorded(tmp_path, kind), tmp_path / "t", "--calibration", calibration)
    assert done.exit_code == 0, done.output
    plain = json.loads((tmp_path / "t" / MANIFEST).read_text(encoding="utf-8"))
    assert (plain["calibration"], plain["background"], plain["sensor"]) == (
        "calibration.json",
        "background.png",
        "my-sensor",
    )
    (entry,) = plain["touches"]
    assert (entry["name"], entry["image"]) == ("3.000 s", "0.png")
    files = {path.name for path in (tmp_path / "t").iterdir()}
    assert files == {MANIFEST, "0.png", "background.png", "calibration.json"}
    image, background = (read_rgb(tmp_path / "t" / name) for name in ("0.png", "background.png"))
    np.testing.assert_array_equal(image, picture(PRESS, 30))
    np.testing.assert_array_equal(background, picture(0, 0))
    reading = Calibration.load(tmp_path / "t" / "calibration.json").read(image, background)
    assert f" {len(reading.points)} " in done.stdout
    recording = read(tmp_path / "t")
    assert (recording.names, recording.skipped) == (["3.000 s"], {})
    (touch,) = recording.touches
    assert (touch.unit, touch.sensor, touch.contact_area) == (1000.0, "my-sensor", pytest.approx(reading.area))
    np.testing.assert_allclose(touch.errors, reading.errors / 1000)
    # An optical frame looks along +z and y leads down, so that the ball is at y = 0.95 mm of pcsr's frame.
    matrix = np.array(entry["pose"]["matrix"])
    np.testing.assert_allclose(touch.points, reading.points @ matrix[:3, :3].T + matrix[:3, 3], atol=1e-12)
    in_optical = 1000 * POSE[1].inv().apply(touch.points - POSE[0])
    columns, rows = CENTRE
    ball = np.array([(columns - 79.5) * MM_PER_PIXEL, (rows - 59.5) * MM_PER_PIXEL, DIAMETER / 2 - PRESS])
    assert np.abs(np.linalg.norm(in_optical - ball, axis=1) - DIAMETER / 2).max() < 0.2


def test_backgrounds_are_files_or_times(tmp_path, calibration):
    bag = recorded(tmp_path)
    Image.fromarray(picture(0, 99)).save(tmp_path / "rest.png")
    for background, seed in (("0.7", 7), (tmp_path / "rest.png", 99)):
        more = ["--calibration", calibration, "--background", background, "--overwrite"]
        done = imported(bag, tmp_path / "t", *more)
        assert done.exit_code == 0, done.output
        np.testing.assert_array_equal(read_rgb(tmp_path / "t" / "background.png"), picture(0, seed))


def test_images_that_cannot_be_read_count_as_untouched_which_is_said(tmp_path, calibration):
    done = imported(recorded(tmp_path, black=(5, 29)), tmp_path / "t", "--calibration", calibration)
    assert done.exit_code == 0, done.output
    assert "2 of 50 messages cannot be read and count as untouched: /gel/image at 0.500 s: " in done.stderr
    assert read(tmp_path / "t").names == ["3.000 s"]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ([], "--calibration is missing: /gel/image has images in colour: name the sensor's calibration"),
        (["--calibration", "no.json"], "no.json cannot be read"),
        (["--background", "no.png"], "no.png cannot be read"),
        (["--background", "77"], "--background 77: /gel/image has no message within 0.5 s"),
        (["--at", "1"], "/gel/image at 1.000 s: no contact"),
        (["--contact-above", "0.1"], "--contact-above: /gel/image has images in colour, which take none: leave it out"),
        (["--camera-info", "/info"], "--camera-info: /gel/image has images in colour, which take none"),
    ],
)
def test_options_that_do_not_fit(tmp_path, calibration, more, said):
    more = [*more, "--calibration", calibration] if more and "--calibration" not in more else more
    done = imported(recorded(tmp_path), tmp_path / "t", *more)
    assert (done.exit_code, said in done.stderr) == (2, True), done.output
    assert not (tmp_path / "t").exists()


def test_a_calibration_of_other_images_ends_early(tmp_path, calibration):
    with BagWriter(tmp_path) as bag:
        bag.transform("gel", "camera", 0.0, static=True)
        for number in range(30):
            bag.image("/gel/image", number / 10, np.full((60, 80, 3), 100, np.uint8), "rgb8")
    done = imported(bag.path, tmp_path / "t", "--calibration", calibration)
    assert done.exit_code == 2
    said = "/gel/image: its first image, taken as the background, has 80 x 60 pixels, but the calibration of sensor"
    assert said in done.stderr


def test_a_background_that_may_be_of_another_sensor_is_remarked(tmp_path, calibration):
    rest = np.clip(picture(0, 99) * 1.25, 0, 255).astype(np.uint8)
    Image.fromarray(rest).save(tmp_path / "bright.png")
    with BagWriter(tmp_path) as bag:
        bag.transform("gel", "camera", 0.0, static=True)
        for number in range(20):
            bright = np.clip(picture(0.7 - (number / 10 - 1) ** 2, number) * 1.25, 0, 255).astype(np.uint8)
            bag.image("/gel/image", number / 10, bright, "rgb8", frame="gel")
    for what, more in (("--background", ("--background", tmp_path / "bright.png")), ("its first image, taken as ", ())):
        done = imported(bag.path, tmp_path / f"t{len(more)}", "--calibration", calibration, *more)
        assert done.exit_code == 0, done.output
        assert f"/gel/image: {what}" in done.stderr
        assert "differs by 25% from that of the calibration: is it of the sensor 'my-sensor'?" in done.stderr
