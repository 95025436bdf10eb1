import io

import numpy as np
from PIL import Image

from pcsr import Touch
from pcsr.report.recording.pictures import LONGEST, depth_pictures


def picture(points, **fields):
    (data,) = depth_pictures(Touch.single(points, np.eye(4), 1.0, "digit", **fields))
    return np.array(Image.open(io.BytesIO(data)))


def grid(columns=12, rows=8):
    y, x = np.mgrid[:rows, :columns].astype(float)
    return np.stack([x, y, 0.1 + x / columns], axis=-1).reshape(-1, 3)


def test_depth_is_colour_and_y_points_up():
    image = picture(grid())
    assert image.shape[2] == 4
    assert (image[..., 3] == 255).mean() > 0.9
    left, right = image[0, 0, :3].astype(int), image[0, -1, :3].astype(int)
    assert right.sum() > left.sum() + 100  # lightness rises with depth
    corner = picture(np.concatenate([grid(), [[0, 11, 5]] * 3]))
    lit = np.argwhere(np.abs(corner[..., :3].astype(int) - [0xF2, 0xD0, 0x24]).max(axis=2) <= 1)
    assert (lit == [[0, 0]]).all()  # the deepest point is at the top left


def test_the_view_is_shown_where_it_is_known():
    image = picture(grid() * [0.1, 0.1, 1], view=(16.0, 12.0))
    assert max(image.shape[:2]) <= LONGEST + 1
    assert abs(image.shape[1] / image.shape[0] - 16 / 12) < 0.05
    assert 0 < (image[..., 3] == 255).mean() < 0.02


def test_each_finger_has_a_picture_and_a_touch_without_poses_none():
    one = Touch.single(grid(), np.eye(4), 1.0, "digit")
    assert len(depth_pictures(Touch.grasp([one, one]))) == 2
    assert depth_pictures(Touch.single(grid(), None, 1.0, "digit")) == []


def test_a_single_point_and_flat_points_have_pictures():
    assert picture(np.array([[1.0, 2.0, 0.0]])).shape == (1, 1, 4)
    assert picture(np.array([[0.0, 0, 1], [5, 0, 1]])).shape[0] == 1
