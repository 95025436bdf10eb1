"""Reading of camera images: formats, modes, damage."""

import numpy as np
import pytest
from PIL import Image

from pcsr import UserError
from pcsr.sensors import images, read_rgb

PIXELS = np.random.default_rng(0).integers(0, 256, (24, 32, 3)).astype(np.uint8)


@pytest.mark.parametrize("suffix", ["png", "bmp", "PNG"])
def test_lossless_formats_keep_every_level(tmp_path, suffix):
    Image.fromarray(PIXELS).save(tmp_path / f"a.{suffix}")
    np.testing.assert_array_equal(read_rgb(tmp_path / f"a.{suffix}"), PIXELS)
    np.testing.assert_array_equal(read_rgb(str(tmp_path / f"a.{suffix}")), PIXELS)


def test_jpegs_are_read(tmp_path):
    Image.new("RGB", (32, 24), (100, 50, 200)).save(tmp_path / "a.jpg", quality=100)
    assert np.abs(read_rgb(tmp_path / "a.jpg").astype(int) - [100, 50, 200]).max() < 4


def test_transparency_is_left_out_and_palettes_are_colours(tmp_path):
    Image.fromarray(PIXELS).convert("RGBA").save(tmp_path / "a.png")
    np.testing.assert_array_equal(read_rgb(tmp_path / "a.png"), PIXELS)
    few = Image.fromarray(PIXELS).quantize(16)
    few.save(tmp_path / "b.png")
    np.testing.assert_array_equal(read_rgb(tmp_path / "b.png"), np.asarray(few.convert("RGB")))


@pytest.mark.parametrize(("orientation", "turned"), [(1, PIXELS), (3, PIXELS[::-1, ::-1]), (6, np.rot90(PIXELS, -1))])
def test_an_image_is_turned_as_its_file_says(tmp_path, orientation, turned):
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.fromarray(PIXELS).save(tmp_path / "a.png", exif=exif)
    np.testing.assert_array_equal(read_rgb(tmp_path / "a.png"), turned)


@pytest.mark.parametrize("mode", ["L", "LA", "1", "I;16", "CMYK"])
def test_images_without_red_green_and_blue_are_refused(tmp_path, mode):
    name = "a.jpg" if mode == "CMYK" else "a.png"
    Image.new(mode, (32, 24)).save(tmp_path / name)
    with pytest.raises(UserError, match=rf"{name} is an image of mode {mode}, not of red, green and blue: save"):
        read_rgb(tmp_path / name)


def test_damaged_missing_and_other_files_are_named(tmp_path):
    Image.fromarray(PIXELS).save(tmp_path / "whole.png")
    whole = (tmp_path / "whole.png").read_bytes()
    (tmp_path / "short.png").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "noise.png").write_bytes(b"noise")
    (tmp_path / "empty.png").write_bytes(b"")
    Image.fromarray(PIXELS).save(tmp_path / "a.gif")
    (tmp_path / "folder.png").mkdir()
    for name in ("short.png", "noise.png", "empty.png", "a.gif"):
        with pytest.raises(UserError, match=rf"{name} cannot be read as an image: it is damaged, cut off, or no PNG"):
            read_rgb(tmp_path / name)
    for name in ("none.png", "folder.png"):
        with pytest.raises(UserError, match=rf"{name} cannot be read: "):
            read_rgb(tmp_path / name)


def test_an_image_of_too_many_pixels_is_refused_before_it_is_decoded(tmp_path, monkeypatch):
    Image.fromarray(PIXELS).save(tmp_path / "a.png")
    monkeypatch.setattr(images, "MOST_PIXELS", 100)
    with pytest.raises(UserError, match=r"a\.png is an image of 32 x 24 pixels, more than 100"):
        read_rgb(tmp_path / "a.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1)
    with pytest.raises(UserError, match=r"a\.png"):
        read_rgb(tmp_path / "a.png")


def test_an_image_that_pillow_takes_for_an_attack_is_too_large(tmp_path, monkeypatch):
    Image.fromarray(PIXELS).save(tmp_path / "a.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 10)
    with pytest.raises(UserError, match=r"a\.png is an image of more than 16777216 pixels: make it smaller"):
        read_rgb(tmp_path / "a.png")
