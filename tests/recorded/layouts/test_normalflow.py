import json

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial.transform import Rotation

from pcsr import UserError
from pcsr.recorded import read
from tests.recorded.pressed import PITCH, RADIUS, pressed
from tests.sensors.other_programs import gs_sdk

STILL = {"translation": [0, 0, 0], "quaternion": [0, 0, 0, 1], "order": "xyzw"}


def dent(h=30, w=40, row=15.0, column=25.0):
    """A round dent, in pixels: heights are negative where something presses in."""
    v, u = np.mgrid[:h, :w].astype(float)
    depth = 5 * np.exp(-((u - column) ** 2 + (v - row) ** 2) / 18)
    slopes = np.stack([depth * (u - column) / 9, depth * (v - row) / 9], axis=-1)
    return -depth, slopes, depth > 1


@pytest.fixture
def trial(tmp_path):
    """Two frames: in the second the sensor has moved by known steps."""
    _, slopes, mask = dent()
    motion = np.eye(4)
    motion[:3, :3] = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    motion[:3, 3] = [0.001, 0.002, 0.003]
    np.save(tmp_path / "gradient_maps.npy", np.stack([slopes, slopes]))
    np.save(tmp_path / "contact_masks.npy", np.stack([mask, mask]))
    np.save(tmp_path / "nf_start_T_currs.npy", np.stack([np.eye(4), motion]))
    return tmp_path


def say(folder, **options):
    layout = {"name": "normalflow", "mm_per_pixel": PITCH, "start": STILL, "unit": "mm", "object_unit": "mm"}
    (folder / "touches.json").write_text(json.dumps({"format": 1, "layout": layout | options}))
    return read(folder)


def contact():
    """The dent in the sensor's frame as the trial has it: x right, y down, z into the object, in mm."""
    height, _, mask = dent()
    v, u = np.nonzero(mask)
    return np.stack([u - 19.5, v - 14.5, height[mask]], axis=-1) * PITCH


def test_the_first_frame_is_placed_by_start(trial):
    recording = say(trial)
    assert recording.names == ["frame 0", "frame 1"]
    touch = recording.touches[0]
    np.testing.assert_allclose(touch.points, contact(), atol=0.1 * PITCH)
    assert touch.contact_area == pytest.approx(len(contact()) * PITCH**2)
    assert (touch.unit, touch.sensor) == (1.0, "gelsight-mini")
    inverse = np.linalg.inv(touch.poses[0])
    local = touch.points @ inverse[:3, :3].T + inverse[:3, 3]
    # Ours has y up, and z above 0 where something presses in.
    np.testing.assert_allclose(local, contact() * [1, -1, -1], atol=0.1 * PITCH)
    assert local[:, 2].min() > 0


def test_start_carries_the_frame_and_unit_of_the_object(trial):
    start = {"translation": [1, 2, 3], "euler": [90], "axes": "x", "angle": "degrees"}
    touch = say(trial, start=start, unit="cm", object_unit="m").touches[0]
    x, y, z = contact().T
    expected = np.stack([10 + x, 20 - z, 30 + y], axis=-1) / 1000
    np.testing.assert_allclose(touch.points, expected, atol=0.1e-3 * PITCH)


def test_later_frames_move_with_the_sensor(trial):
    touch = say(trial).touches[1]
    x, y, z = contact().T
    np.testing.assert_allclose(touch.points, np.stack([1 - y, 2 + x, 3 + z], axis=-1), atol=0.1 * PITCH)


def frames():
    """Three presses of a ball: indentation in mm, contact, and the ball's centre in the sensor's frame."""
    for press, row, column in ((0.6, 60.0, 80.0), (0.5, 55.0, 92.0), (0.75, 66.0, 74.0)):
        indentation, contact = pressed(press, middle=(row, column))
        yield indentation, contact, np.array([(column - 79.5) * PITCH, (row - 59.5) * PITCH, RADIUS - press])


def remapped(image, points):
    """Values of an image where points in mm are."""
    places = points[:, 1] / PITCH + 59.5, points[:, 0] / PITCH + 79.5
    return ndimage.map_coordinates(image.astype(float), places, order=1)


def tracked(folder, poses):
    """Write the frames as a trial, with motions whose z is found as NormalFlow finds it; the true motions."""
    slopes, masks, exact, motions = [], [], [], []
    clouds, heights, centres = [], [], []
    for (indentation, contact, centre), turn in zip(frames(), ([0, 0, 0], [3, -2, 15], [-2, 4, -10]), strict=True):
        slopes.append(np.stack(np.gradient(-indentation / PITCH)[::-1], axis=-1))
        masks.append(contact)
        heights.append(gs_sdk(slopes[-1]) * PITCH)
        v, u = np.nonzero(contact)
        clouds.append(np.stack([(u - 79.5) * PITCH, (v - 59.5) * PITCH, heights[-1][contact]], axis=-1))
        centres.append(centre)
        to_frame = np.eye(4)  # from the first frame
        to_frame[:3, :3] = Rotation.from_euler("xyz", turn, degrees=True).as_matrix()
        to_frame[:3, 3] = centre - to_frame[:3, :3] @ centres[0]
        exact.append(np.linalg.inv(to_frame))
        points = clouds[0] @ to_frame[:3, :3].T + [*to_frame[:2, 3], 0]
        both = remapped(contact, points) > 0.5
        to_frame[2, 3] = (remapped(heights[-1], points) - points[:, 2])[both].mean()
        motions.append(np.linalg.inv(to_frame))
        motions[-1][:3, 3] /= 1000
    np.save(folder / "gradient_maps.npy", np.array(slopes))
    np.save(folder / "contact_masks.npy", np.array(masks))
    np.save(folder / f"{poses}_start_T_currs.npy", np.array(motions))
    return exact, centres[0]


def test_tracked_frames_lie_on_one_surface(tmp_path):
    exact, centre = tracked(tmp_path, "nf")
    recording = say(tmp_path)
    off = [np.linalg.norm(touch.points - centre, axis=1) - RADIUS for touch in recording.touches]
    assert max(abs(one.mean()) for one in off) < 0.003
    for touch, motion in zip(recording.touches, exact, strict=True):
        np.testing.assert_allclose(touch.poses[0, :3, 3], motion[:3, 3], atol=0.005)


def test_measured_motions_stay_as_they_are(tmp_path):
    exact, _ = tracked(tmp_path, "true")
    motions = np.load(tmp_path / "true_start_T_currs.npy")
    recording = say(tmp_path)
    for touch, motion, tracked_exact in zip(recording.touches, motions, exact, strict=True):
        np.testing.assert_allclose(touch.poses[0, :3, 3], motion[:3, 3] * 1000, atol=1e-12)
        assert np.array_equal(motion, np.eye(4)) or abs(motion[2, 3] * 1000 - tracked_exact[2, 3]) > 0.02


def test_every_so_many_frames_are_touches(trial):
    assert say(trial, every=2).names == ["frame 0"]


def test_a_gel_in_contact_everywhere_has_its_face_at_the_highest(trial):
    np.save(trial / "contact_masks.npy", np.ones((2, 30, 40), np.uint8))
    touch = say(trial).touches[0]
    assert touch.points[:, 2].max() == pytest.approx(0, abs=1e-12)
    assert len(touch.points) == 1200


def test_frames_that_lack_something_are_left_out(trial):
    masks = np.load(trial / "contact_masks.npy")
    masks[0] = False
    np.save(trial / "contact_masks.npy", masks)
    recording = say(trial)
    assert recording.names == ["frame 1"]
    assert "no contact" in recording.skipped["frame 0"]
    motions = np.load(trial / "nf_start_T_currs.npy")
    motions[1, :3, :3] *= 2
    np.save(trial / "nf_start_T_currs.npy", motions)
    with pytest.raises(UserError, match=r"frame 1: .*pose 1 scales by 2"):
        say(trial)


def test_files_that_do_not_fit_together_are_refused(trial):
    np.save(trial / "contact_masks.npy", np.ones((3, 30, 40), bool))
    with pytest.raises(UserError, match="do not fit together"):
        say(trial)
    np.save(trial / "contact_masks.npy", np.ones((2, 30), bool))
    with pytest.raises(UserError, match=r"contact_masks\.npy must hold numbers of shape \(n, h, w\)"):
        say(trial)
    (trial / "contact_masks.npy").write_bytes(b"noise")
    with pytest.raises(UserError, match=r"contact_masks\.npy cannot be read"):
        say(trial)
    np.save(trial / "contact_masks.npy", np.array([None]))
    with pytest.raises(UserError, match=r"contact_masks\.npy cannot be read"):
        say(trial)
    (trial / "contact_masks.npy").unlink()
    with pytest.raises(UserError, match=r"contact_masks\.npy cannot be read: No such file"):
        say(trial)


def test_pixels_per_mm_are_named(trial):
    with pytest.raises(UserError, match=r"18\.6 looks like pixels per mm"):
        say(trial, mm_per_pixel=18.6)


def test_slopes_that_are_not_finite_are_refused(trial):
    gradients = np.load(trial / "gradient_maps.npy")
    gradients[1, 0, 0, 0] = np.nan
    np.save(trial / "gradient_maps.npy", gradients)
    recording = say(trial)
    assert recording.names == ["frame 0"]
    assert recording.skipped == {"frame 1": "a slope in gradient_maps.npy is not finite"}


def test_one_of_several_motions_must_be_named(trial):
    np.save(trial / "icp_start_T_currs.npy", np.stack([np.eye(4)] * 2))
    with pytest.raises(UserError, match=r"2 files .* \(icp_start_T_currs.npy, nf_start_T_currs.npy\): name one"):
        say(trial)
    touch = say(trial, poses="icp_start_T_currs.npy").touches[1]
    np.testing.assert_allclose(touch.points, contact(), atol=0.1 * PITCH)
    with pytest.raises(UserError, match="is not inside"):
        say(trial, poses="../nf_start_T_currs.npy")


def test_what_nobody_can_guess_must_be_said(trial):
    layout = {"name": "normalflow"}
    (trial / "touches.json").write_text(json.dumps({"format": 1, "layout": layout}))
    with pytest.raises(UserError) as caught:
        read(trial)
    for key in ("mm_per_pixel", "start", "unit", "object_unit"):
        assert f"layout.{key} is missing: add it" in str(caught.value)
