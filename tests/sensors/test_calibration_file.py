"""The file of a calibration: exact, and checked."""

import json
from dataclasses import replace

import numpy as np
import pytest

from pcsr import RunError, UserError
from pcsr.sensors import Calibration, Gel, calibration_file
from tests.sensors.synthetic import background, ball, calibrated, photo


@pytest.mark.parametrize("gel", [Gel(), Gel((50.0, 23.0), None), Gel(None, 4.25)])
def test_what_is_read_is_what_was_written_to_the_bit(tmp_path, gel):
    made = replace(calibrated(), gel=gel, sensor="Größe „1“")
    made.save(tmp_path / "a.json")
    again = Calibration.load(str(tmp_path / "a.json"))
    for name in ("sensor", "gel", "columns", "rows", "mm_per_pixel", "figures"):
        assert getattr(again, name) == getattr(made, name)
    np.testing.assert_array_equal(again.coefficients, made.coefficients)
    np.testing.assert_array_equal(again.background, made.background)
    image, rest = photo(ball()), background()
    np.testing.assert_array_equal(again.read(image, rest).points, made.read(image, rest).points)
    again.save(tmp_path / "b.json")
    assert (tmp_path / "b.json").read_bytes() == (tmp_path / "a.json").read_bytes()


@pytest.fixture
def plain(tmp_path):
    calibrated().save(tmp_path / "a.json")
    return json.loads((tmp_path / "a.json").read_text())


def test_a_file_that_an_editor_of_windows_saved_is_read(tmp_path, plain):
    text = (tmp_path / "a.json").read_text(encoding="utf-8")
    (tmp_path / "b.json").write_text(text.replace("\n", "\r\n"), encoding="utf-8-sig", newline="")
    assert Calibration.load(tmp_path / "b.json").columns == plain["columns"]


def mistake(tmp_path, text):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(UserError) as caught:
        Calibration.load(tmp_path / "a.json")
    assert str(caught.value).startswith(str(tmp_path / "a.json"))
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("coefficients", [[float("inf"), 0]], "coefficients"),
        ("mm_per_pixel", float("nan"), "mm_per_pixel: it must be "),
        ("mm_per_pixel", 0, "mm_per_pixel: it must be more than 0"),
        ("columns", 1e5, "columns: it must be a whole number"),
        ("columns", 7, "columns: it must be 8 or more, got 7"),
        ("rows", 10**9, "rows: it must be at most 16384"),
        ("sensor", "", "sensor: it must be text of 1 character"),
        ("sensor", None, "sensor: it must be text"),
        ("sensor", "a\x1b[31m\nb", "sensor: the name must have no control characters"),
        ("mm_per_pixel", 8.3, "mm_per_pixel: with 8.3 the image is 1328 × 996 mm, more than 100 mm: 8.3 looks like"),
        ("gel", {"dome": [0.1, 0.1], "thickness": None}, "dome: with radii of 0.1 and 0.1 mm the corners"),
        ("gel", {"dome": [50], "thickness": None}, "gel.dome"),
        ("gel", {"dome": [50, -1], "thickness": None}, "gel.dome.1"),
        ("gel", {"dome": None, "thickness": 1e9}, "gel.thickness: it must be at most 1000"),
        ("held_out", [], "held_out: it must be a mapping"),
        ("background", [[[1, 2]]], "background.0.0: it must be a list of 3 items"),
        ("background", [[[1, 2, 300]]], "background.0.0.2: it must be at most 255"),
        ("background", [[[1, 2, 3]]], "background must be 6 rows of 8 colours"),
        ("background", [[[0, 0, 0]] * 8] * 6, "background must be 6 rows of 8 colours"),
    ],
)
def test_numbers_that_no_calibration_has_are_named(tmp_path, plain, key, value, said):
    assert said in mistake(tmp_path, json.dumps(plain | {key: value}))


@pytest.mark.parametrize("key", ["coefficients", "format", "sensor", "gel", "held_out", "background", "rows"])
def test_missing_keys_are_named(tmp_path, plain, key):
    del plain[key]
    assert f"{key} is missing: add it" in mistake(tmp_path, json.dumps(plain))


@pytest.mark.parametrize("text", ["", "{", "null", "[]", "7", "\x00", '{"format": 1, "format": '])
def test_what_is_no_calibration_is_refused(tmp_path, text):
    assert "is no calibration of a sensor" in mistake(tmp_path, text)


def test_images_of_too_many_pixels_are_refused(tmp_path, plain):
    said = mistake(tmp_path, json.dumps(plain | {"rows": 1 << 14, "columns": 1 << 14}))
    assert "images of 16384 x 16384 pixels have more than" in said


def test_missing_and_large_files_are_named(tmp_path, monkeypatch):
    with pytest.raises(UserError, match=r"none\.json cannot be read: "):
        Calibration.load(tmp_path / "none.json")
    calibrated().save(tmp_path / "a.json")
    monkeypatch.setattr(calibration_file, "LARGEST_FILE", 100)
    with pytest.raises(UserError, match=r"a\.json has .* more than the"):
        Calibration.load(tmp_path / "a.json")


def test_a_file_that_cannot_be_written_leaves_the_old_one(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RunError, match=r"could not be written"):
        calibrated().save(tmp_path / "file" / "a.json")
    with pytest.raises(UserError, match="is a folder"):
        calibrated().save(tmp_path)
