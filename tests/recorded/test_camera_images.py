"""Touches that are camera images of a calibrated sensor."""

import numpy as np
import pytest

from pcsr.recorded import read, write
from tests.recorded.recordings import STILL, only, reason, record
from tests.sensors.synthetic import background, ball, calibrated, photo, save

TURNED = {"translation": [10, 0, 5], "quaternion": [1, 0, 0, 0], "order": "xyzw"}
ENTRY = {"image": "0.png", "background": "bg.png", "calibration": "x.json", "pose": STILL}


@pytest.fixture
def folder(tmp_path):
    save(tmp_path / "0.png", photo(ball()))
    save(tmp_path / "bg.png", background())
    calibrated().save(tmp_path / "x.json")
    return tmp_path


def test_an_image_is_read_by_its_calibration(folder):
    touch = only(folder, ENTRY | {"pose": TURNED}, object_unit="m")
    reading = calibrated().read(photo(ball()), background())
    np.testing.assert_allclose(touch.points * 1000, reading.points * [1, -1, -1] + [10, 0, 5], atol=1e-12)
    np.testing.assert_allclose(touch.errors * 1000, reading.errors)
    assert touch.contact_area == reading.area
    assert touch.view == reading.view == pytest.approx((19.2, 14.4))
    assert touch.sensor == "digit"


def test_background_and_calibration_of_the_whole_recording(folder):
    short = {"image": "0.png", "pose": STILL}
    touch = only(folder, short, background="bg.png", calibration="x.json")
    np.testing.assert_array_equal(touch.points, only(folder, ENTRY).points)
    assert "background is missing" in reason(folder, short, calibration="x.json")
    assert "pcsr sensor calibrate" in reason(folder, short, background="bg.png")


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"image": "none.png"}, "none.png"),
        ({"image": "../0.png"}, "not inside"),
        ({"calibration": "0.png"}, "is no calibration of a sensor"),
        ({"image": "bg.png"}, "no contact"),
        ({"pose": None}, "pose is missing"),
        ({"mm_per_pixel": 0.1}, "takes no 'mm_per_pixel'"),
    ],
)
def test_a_mistake_leaves_out_one_touch(folder, keys, message):
    assert message in reason(folder, ENTRY | keys)


def test_an_image_of_another_size_is_named(folder):
    save(folder / "small.png", photo(ball())[::2])
    assert "small.png: it has 160 x 60 pixels" in reason(folder, ENTRY | {"image": "small.png"})


def test_errors_of_points_are_written_and_read_to_the_last_bit(folder, tmp_path):
    recording = read(record(folder, ENTRY))
    write(tmp_path / "again", recording.touches)
    again = read(tmp_path / "again").touches[0]
    np.testing.assert_array_equal(again.errors, recording.touches[0].errors)
    np.testing.assert_array_equal(again.points, recording.touches[0].points)


def test_the_column_error_of_a_cloud_is_in_the_clouds_unit(tmp_path):
    (tmp_path / "0.csv").write_text("x,y,z,error\n1,2,3,0.1\n4,5,6,0.2\n")
    entry = {"cloud": "0.csv", "unit": "cm", "pose": STILL}
    np.testing.assert_allclose(only(tmp_path, entry).errors, [0.001, 0.002])
    for wrong in ("-0.1", "nan"):
        (tmp_path / "1.csv").write_text(f"x,y,z,error\n1,2,3,{wrong}\n4,5,6,0.2\n")
        assert "finite, and 0 or more" in reason(tmp_path, entry | {"cloud": "1.csv"})
