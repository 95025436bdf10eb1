import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from pcsr import UserError
from pcsr.recorded.images import depth_contact, height_contact, read_image, same_size
from pcsr.recorded.manifest import Intrinsics
from pcsr.sensors import images

LEVELS = np.arange(12, dtype=np.uint8).reshape(3, 4) * 20


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_grey_pictures_keep_every_level(tmp_path, dtype):
    levels = (np.arange(12).reshape(3, 4) * (np.iinfo(dtype).max // 12)).astype(dtype)
    Image.fromarray(levels).save(tmp_path / "a.PNG")
    image = read_image(tmp_path / "a.PNG")
    assert image.dtype == np.float64
    np.testing.assert_array_equal(image, levels)


def test_jpegs_are_read_as_they_are(tmp_path):
    Image.fromarray(np.full((8, 8), 100, np.uint8)).save(tmp_path / "a.jpg", quality=100)
    np.testing.assert_array_equal(read_image(tmp_path / "a.jpg"), np.full((8, 8), 100.0))


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.uint16, bool])
def test_arrays_of_any_numbers_are_images(tmp_path, dtype):
    np.save(tmp_path / "a.npy", LEVELS.astype(dtype))
    np.testing.assert_array_equal(read_image(tmp_path / "a.npy"), LEVELS.astype(dtype))


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "P", "LA", "CMYK", "1"])
def test_pictures_in_colour_are_refused(tmp_path, mode):
    name = "a.jpg" if mode == "CMYK" else "a.png"
    Image.new(mode, (4, 3)).save(tmp_path / name)
    with pytest.raises(UserError, match=rf"is an image of mode {mode}: heights, depths and masks must be grey"):
        read_image(tmp_path / name)


@pytest.mark.parametrize(
    ("array", "reason"),
    [
        (np.zeros((3, 4, 3)), r"float64 of shape \(3, 4, 3\)"),
        (np.zeros(3), r"shape \(3,\)"),
        (np.zeros((0, 3)), r"shape \(0, 3\)"),
        (np.array([["a"]]), "<U1"),
        (np.ones((2, 2), complex), "complex128"),
        (np.array({"a": 1}, object), "holds dict"),
    ],
)
def test_arrays_that_are_no_image_are_refused(tmp_path, array, reason):
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(UserError, match=reason):
        read_image(tmp_path / "a.npy")


def test_damaged_and_missing_files_are_named(tmp_path):
    for suffix in (".npy", ".png", ".jpg"):
        (tmp_path / f"a{suffix}").write_bytes(b"noise")
        for name in (f"a{suffix}", f"none{suffix}"):
            with pytest.raises(UserError, match=rf"{name} cannot be read"):
                read_image(tmp_path / name)
    Image.fromarray(np.random.default_rng(0).integers(0, 255, (64, 64)).astype(np.uint8)).save(tmp_path / "b.png")
    (tmp_path / "c.png").write_bytes((tmp_path / "b.png").read_bytes()[:2000])
    with pytest.raises(UserError, match=r"c\.png cannot be read as an image"):
        read_image(tmp_path / "c.png")
    with pytest.raises(UserError, match=r"unknown image format '\.bmp': use one of \.npy, \.png"):
        read_image(tmp_path / "a.bmp")


def test_a_picture_that_is_a_bomb_is_refused(tmp_path, monkeypatch):
    Image.fromarray(LEVELS).save(tmp_path / "a.png")
    monkeypatch.setattr(images, "MOST_PIXELS", 10)
    with pytest.raises(UserError, match=r"a\.png is an image of \d+ x \d+ pixels, more than 10"):
        read_image(tmp_path / "a.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 1)
    with pytest.raises(UserError, match=r"a\.png is an image of more than 10 pixels"):
        read_image(tmp_path / "a.png")


@given(h=st.integers(1, 6), w=st.integers(1, 6), seed=st.integers(0, 99), pitch=st.floats(0.01, 10))
def test_heights_are_seen_from_straight_above(h, w, seed, pitch):
    rng = np.random.default_rng(seed)
    height, contact = rng.normal(size=(h, w)), rng.random((h, w)) < 0.5
    contact[rng.integers(h), rng.integers(w)] = True
    points, area = height_contact(height, pitch, contact)
    slow = [
        ((u - (w - 1) / 2) * pitch, -(v - (h - 1) / 2) * pitch, height[v, u])
        for v in range(h)
        for u in range(w)
        if contact[v, u]
    ]
    np.testing.assert_allclose(points, slow, atol=1e-12)
    assert area == pytest.approx(len(slow) * pitch**2)


@given(h=st.integers(1, 6), w=st.integers(1, 6), seed=st.integers(0, 99))
def test_depths_are_seen_through_a_pinhole(h, w, seed):
    rng = np.random.default_rng(seed)
    depth, contact = rng.uniform(15, 25, size=(h, w)), rng.random((h, w)) < 0.5
    contact[0, 0] = True
    camera = Intrinsics(fx=30.0, fy=20.0, cx=1.5, cy=2.0)
    points, area = depth_contact(depth, camera, 22.0, contact)
    # Each point is projected back into the image that it came from.
    from_camera = points - [0, 0, 22]
    assert (from_camera[:, 2] < 0).all()  # the camera looks along -z
    u = from_camera[:, 0] / -from_camera[:, 2] * 30 + 1.5
    v = -from_camera[:, 1] / -from_camera[:, 2] * 20 + 2
    np.testing.assert_allclose(np.stack([v, u]), np.nonzero(contact), atol=1e-9)
    np.testing.assert_allclose(-from_camera[:, 2], depth[contact])
    assert area == pytest.approx(sum(d * d / 600 for d in depth[contact]))


def test_pixels_without_a_depth_are_in_no_contact():
    depth = np.array([[0.0, np.nan, np.inf, -1.0, 20.0]])
    camera = Intrinsics(fx=1.0, fy=1.0, cx=0.0, cy=0.0)
    points, _ = depth_contact(depth, camera, 22.0, np.ones((1, 5), bool))
    assert points.tolist() == [[80, 0, 2]]
    with pytest.raises(UserError, match="none of the 4 pixels is in contact"):
        depth_contact(depth[:, :4], camera, 22.0, np.ones((1, 4), bool))
    with pytest.raises(UserError, match="none of the 5 pixels is in contact"):
        height_contact(depth, 1.0, np.zeros((1, 5), bool))


def test_sizes_must_fit():
    same_size(LEVELS, LEVELS, "mask")
    same_size(LEVELS, None, "mask")
    with pytest.raises(UserError, match=r"the mask has \(4, 3\) rows and columns, and the image \(3, 4\)"):
        same_size(LEVELS, LEVELS.T, "mask")
