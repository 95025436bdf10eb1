"""Contact in the images of a pressed gel."""

import numpy as np
import pytest
from scipy import fft

from pcsr.recorded.gel_images import touching
from tests.recorded.pressed import PITCH, pressed
from tests.recorded.recordings import STILL, only, reason

HEIGHT = {"height": "h.npy", "mm_per_level": 1, "mm_per_pixel": PITCH, "indentation": "positive", "pose": STILL}
CAMERA = {"fx": 300.0, "fy": 300.0, "cx": 79.5, "cy": 59.5}
DEPTH = {"depth": "d.npy", "unit": "mm", "intrinsics": CAMERA, "face": 22.0, "pose": STILL}


def height(folder, heights, **keys):
    np.save(folder / "h.npy", heights)
    return only(folder, HEIGHT | keys, object_unit="mm")


def why(folder, heights, sensor="digit", **keys):
    np.save(folder / "h.npy", heights)
    return reason(folder, HEIGHT | keys, object_unit="mm", sensor=sensor)


def test_a_threshold_takes_what_is_above_it_and_the_rule_what_is_in_contact():
    indentation, contact = pressed()
    np.testing.assert_array_equal(touching(indentation, None), contact)
    np.testing.assert_array_equal(touching(indentation, 0.1), indentation > 0.1)
    assert touching(indentation, 0.1).sum() > 1.5 * contact.sum()
    assert not touching(np.full((4, 4), np.nan), 0.0).any()


def test_a_gel_at_rest_is_not_in_contact():
    noise = np.random.default_rng(0).uniform(-0.04, 0.04, (60, 80))
    assert not touching(noise, None).any()


def test_height_entries_find_the_contact_themselves(tmp_path):
    indentation, contact = pressed()
    touch = height(tmp_path, indentation)
    assert len(touch.points) == contact.sum()
    assert touch.contact_area == pytest.approx(contact.sum() * PITCH**2)
    assert touch.view == (160 * PITCH, 120 * PITCH)
    assert touch.points[:, 2].max() == pytest.approx(0.84, abs=1e-3)


def test_a_mask_restricts_the_contact(tmp_path):
    indentation, contact = pressed()
    mask = np.zeros(contact.shape, bool)
    mask[:, :70] = True
    np.save(tmp_path / "mask.npy", mask)
    touch = height(tmp_path, indentation, mask="mask.npy")
    deepest = indentation[mask].max()
    assert len(touch.points) == (mask & (indentation > 0.4 * deepest)).sum()
    assert touch.view is None
    touch = height(tmp_path, indentation, mask="mask.npy", contact_above=0.01)
    assert len(touch.points) == (mask & (indentation > 0.01)).sum()


def test_where_a_second_contact_is_left_out_the_object_may_be(tmp_path):
    first, contact = pressed(middle=(60, 40))
    second, _ = pressed(0.6, middle=(60, 120))
    touch = height(tmp_path, np.maximum(first, second))
    assert len(touch.points) == pytest.approx(contact.sum(), rel=0.01)
    assert touch.view is None


def test_the_height_of_the_untouched_gel_is_subtracted(tmp_path):
    indentation, contact = pressed()
    expected = height(tmp_path, indentation).points
    touch = height(tmp_path, 5.8 - indentation, rest=5.8, indentation="negative")
    np.testing.assert_allclose(touch.points, expected, atol=1e-12)
    assert touch.view is not None
    flat = np.full(contact.shape, 0.3)
    assert len(height(tmp_path, flat, rest=0).points) == flat.size  # a flat object that fills the view


@pytest.mark.parametrize("program", ["gs_sdk", "gsrobotics"])
def test_heights_of_other_programs_are_corrected(tmp_path, program):
    indentation, contact = pressed()
    h, w = indentation.shape
    k, m = np.arange(1, h + 1)[:, None], np.arange(1, w + 1)
    own = np.sin(np.pi * (k - 1) / (2 * h)) ** 2 + np.sin(np.pi * (m - 1) / (2 * w)) ** 2
    following = np.sin(np.pi * k / (2 * h)) ** 2 + np.sin(np.pi * m / (2 * w)) ** 2
    gain = 2 if program == "gs_sdk" else 1
    theirs = fft.idctn(fft.dctn(-indentation / PITCH) * gain * own / following) + 0.3
    keys = {"mm_per_level": PITCH, "indentation": "negative"}
    touch = height(tmp_path, theirs, integration=program, **keys)
    assert len(touch.points) == contact.sum()
    level = np.median(indentation[~contact])
    np.testing.assert_allclose(touch.points[:, 2], (indentation - level)[contact], atol=1e-4)
    assert level < 0.02
    np.save(tmp_path / "bg.npy", np.random.default_rng(0).normal(size=(h, w)))
    noisy = theirs + np.load(tmp_path / "bg.npy")
    touch = height(tmp_path, noisy, background="bg.npy", integration=program, **keys)
    np.testing.assert_allclose(touch.points[:, 2], (indentation - level)[contact], atol=1e-4)


def test_keys_that_contradict_each_other_are_refused(tmp_path):
    indentation, _ = pressed()
    np.save(tmp_path / "bg.npy", indentation)
    assert "rest and background are both heights" in why(tmp_path, indentation, rest=1, background="bg.npy")
    assert "the heights of gs_sdk have no level" in why(tmp_path, indentation, rest=1, integration="gs_sdk")
    assert "integration: it must be 'exact', 'gs_sdk' or 'gsr" in why(tmp_path, indentation, integration="gssdk")


def test_the_wrong_sign_is_named(tmp_path):
    indentation, _ = pressed(bulge=0.1)
    text = why(tmp_path, indentation, indentation="negative")
    assert "the surface goes 0.1 mm into the gel and 0.7" in text
    assert "give the other sign, or correct the height of the untouched gel" in text
    assert height(tmp_path, indentation).points[:, 2].max() == pytest.approx(0.74, abs=0.01)
    indentation[3, 4] = -8  # a single wrong pixel tells nothing
    assert len(height(tmp_path, indentation).points) > 100


def test_heights_in_pixels_are_named(tmp_path):
    indentation, _ = pressed()
    for sensor in ("digit", "GelSight Mini"):
        text = why(tmp_path, indentation / PITCH, sensor)
        assert f"indented by 13.25 mm, more than the 5 mm that the gel of {sensor} is thick" in text
        assert "heights in pixels take mm_per_level 0.0634, the mm_per_pixel" in text
    text = why(tmp_path, 3 * indentation / PITCH, "mine")
    assert "indented by 39.75 mm, more than the 30 mm that any gel is thick" in text
    np.save(tmp_path / "h.npy", indentation / PITCH)
    assert len(read_points(tmp_path, "mine")) > 100


def read_points(folder, sensor):
    return only(folder, HEIGHT, sensor=sensor, object_unit="mm").points


def test_an_image_in_contact_everywhere_needs_the_height_of_the_untouched_gel(tmp_path):
    text = why(tmp_path, 2.9 + pressed()[0])
    assert "100% of the pixels are in contact, so the height of the untouched gel is probably not 0" in text
    assert "as rest (0 if it is right), or an image of it as background" in text


def test_pixels_per_mm_are_named(tmp_path):
    indentation, _ = pressed()
    text = why(tmp_path, indentation, mm_per_pixel=18.6)
    assert "with 18.6 the image is 2976 × 2232 mm, more than 100 mm: 18.6 looks like pixels per mm: 1 / 18.6 =" in text
    assert "= 0.0538" in text
    assert "give the side of a pixel in mm" in why(tmp_path, indentation, mm_per_pixel=0.7)
    taxels = np.zeros((6, 6))
    taxels[2:4, 2:4] = 1.0
    assert len(height(tmp_path, taxels, mm_per_pixel=4.0).points) == 4


def test_depth_entries_find_the_contact_themselves(tmp_path):
    indentation, contact = pressed()
    depth = 22 - indentation
    depth[0, :5] = 0  # no depth there
    np.save(tmp_path / "d.npy", depth)
    touch = only(tmp_path, DEPTH, object_unit="mm")
    assert len(touch.points) == contact.sum()
    dome = np.linspace(0, 4, 160) * np.ones((120, 1))
    np.save(tmp_path / "d.npy", np.where(depth > 0, depth + dome, 0))
    np.save(tmp_path / "bg.npy", 22 + dome)
    touch = only(tmp_path, DEPTH | {"background": "bg.npy"}, object_unit="mm")
    assert len(touch.points) == contact.sum()
    np.save(tmp_path / "d.npy", 22 + dome - 10 * indentation)
    text = reason(tmp_path, DEPTH | {"background": "bg.npy"})
    assert "more than the 5 mm that the gel of digit is thick: correct unit or background" in text
    np.save(tmp_path / "d.npy", depth)
    text = reason(tmp_path, DEPTH | {"face": 60, "contact_above": 1})
    assert "indented by 38.84 mm, more than the 30 mm that any gel is thick: correct unit or face" in text


def test_images_of_a_gel_at_rest_are_no_touches(tmp_path):
    rest = np.random.default_rng(0).uniform(-0.02, 0.02, (30, 40))
    assert "no contact: none of the 1200 pixels is in contact" in why(tmp_path, rest)
    np.save(tmp_path / "d.npy", 22 - rest)
    assert "no contact" in reason(tmp_path, DEPTH)
