"""Images of depths and colours, of any row length and byte order, and intrinsics."""

from io import BytesIO
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from pcsr import UserError
from pcsr.ros.bag import Bag
from pcsr.ros.images import colours, depth, intrinsics, is_depth

RNG = np.random.default_rng(0)
RGB = RNG.integers(0, 256, (5, 7, 3), dtype=np.uint8)


def message(pixels, encoding, **changed):
    pixels = np.ascontiguousarray(pixels)
    data = pixels.view(np.uint8).reshape(-1)
    rows, columns = pixels.shape[:2]
    whole = {"height": rows, "width": columns, "encoding": encoding, "is_bigendian": 0, "step": len(data) // rows}
    return SimpleNamespace(**whole | {"data": data} | changed)


def compressed(data, kind="rgb8; png compressed"):
    return SimpleNamespace(format=kind, data=np.frombuffer(data, np.uint8))


def encoded(pixels, kind, **options):
    file = BytesIO()
    Image.fromarray(pixels).save(file, kind, **options)
    return file.getvalue()


@pytest.mark.parametrize("pad", [0, 3])
def test_images_of_a_bag(any_bag, pad):
    depths = np.array([[20, 21.5, 0], [np.nan, np.inf, 22]])
    with any_bag:
        any_bag.image("/rgb", 0.0, RGB, "rgb8", pad=pad)
        any_bag.image("/bgr", 0.0, RGB[:, :, ::-1], "bgr8", pad=pad)
        any_bag.image("/metres", 0.0, (depths / 1000).astype("f4"), "32FC1", pad=4 * pad)
        any_bag.image("/mm", 0.0, np.nan_to_num(depths, nan=0, posinf=0).astype("u2"), "16UC1", pad=pad)
        any_bag.compressed("/png", 0.0, encoded(RGB, "PNG"))
        any_bag.camera_info("/info", 0.0, 280.0, 281.0, 160.5, 120.5, (240, 320))
    with Bag([any_bag.path]) as bag:
        read = {topic: bag.last(topic).content for topic in bag.topics}
    for topic in ("/rgb", "/bgr", "/png"):
        assert not is_depth(read[topic])
        np.testing.assert_array_equal(colours(read[topic]), RGB)
    none = np.isnan(depths) | np.isinf(depths) | (depths == 0)
    np.testing.assert_allclose(depth(read["/metres"]), np.where(none, np.nan, depths), rtol=1e-6)
    np.testing.assert_array_equal(depth(read["/mm"]), np.where(none, np.nan, np.floor(depths)))
    assert intrinsics(read["/info"]) == (280.0, 281.0, 160.5, 120.5)


def test_depths_in_the_other_byte_order():
    pixels = np.array([[20, 300]])
    np.testing.assert_array_equal(depth(message(pixels.astype(">u2"), "16UC1", is_bigendian=1)), pixels)
    np.testing.assert_array_equal(depth(message(pixels.astype(">f4"), "32FC1", is_bigendian=1)), pixels * 1000)


def test_a_jpeg_is_decoded():
    even = np.full((16, 16, 3), (200, 100, 50), np.uint8)
    assert np.abs(colours(compressed(encoded(even, "JPEG", quality=95), "jpeg")).astype(int) - even).max() < 4


@pytest.mark.parametrize("encoding", ["mono8", "rgba8", "bayer_rggb8", "8UC3", "yuv422", ""])
def test_other_encodings_are_refused(encoding):
    said = f"its images have the encoding '{encoding}': 32FC1, 16UC1, rgb8, bgr8, PNG and JPEG are supported"
    for read in (is_depth, depth, colours):
        with pytest.raises(UserError, match=said):
            read(message(RGB, encoding))


@pytest.mark.parametrize(
    "changed", [{"step": 20}, {"height": 6}, {"width": 8}, {"data": np.zeros(3, np.uint8)}, {"step": 2**32 - 1}]
)
def test_an_image_with_too_few_data_is_refused(changed):
    with pytest.raises(UserError, match=r"its image of . x . pixels .* it is damaged"):
        colours(message(RGB, "rgb8", **changed))


@pytest.mark.parametrize("size", [{"height": 0}, {"width": 0}, {"height": 2**16, "width": 2**16}])
def test_an_image_without_or_with_too_many_pixels_is_refused(size):
    with pytest.raises(UserError, match=r"pixels, and 1 to 16777216 are supported"):
        colours(message(RGB, "rgb8", **size))


def test_compressed_images_that_are_damaged_grey_or_of_depths_are_refused():
    for data, kind, said in [
        (encoded(RGB, "PNG")[:60], "png", "cannot be decoded"),
        (b"GIF89a", "gif", "cannot be decoded: it is damaged, or no PNG or JPEG"),
        (encoded(RGB[:, :, 0], "PNG"), "png", "have the mode L"),
        (encoded(RGB, "PNG"), "16UC1; compressedDepth png", "record the depth images uncompressed"),
    ]:
        with pytest.raises(UserError, match=said):
            colours(compressed(data, kind))


def test_depths_are_no_colours_and_colours_no_depths():
    with pytest.raises(UserError, match="'rgb8', and no depths"):
        depth(message(RGB, "rgb8"))
    with pytest.raises(UserError, match="'16UC1', and no colours"):
        colours(message(np.ones((2, 2), "u2"), "16UC1"))


def test_a_camera_that_is_not_calibrated_is_refused():
    for matrix in (np.zeros(9), np.full(9, np.nan)):
        with pytest.raises(UserError, match="calibrate the camera"):
            intrinsics(SimpleNamespace(k=matrix))
