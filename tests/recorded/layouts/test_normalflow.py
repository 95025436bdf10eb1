import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pcsr import UserError
from pcsr.recorded import read
from pcsr.sensors.integration import integrated

PITCH = 0.0634
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


def test_motions_are_of_surfaces_that_are_0_on_average(trial):
    # The sensor goes on turning about an axis through that average: a second frame with a larger dent
    # has another average, and what its motion says must be said of that.
    _, slopes, mask = dent()
    turned = np.eye(4)
    turned[:3, :3] = Rotation.from_euler("x", 90, degrees=True).as_matrix()
    np.save(trial / "gradient_maps.npy", np.stack([slopes, 2 * slopes]))
    np.save(trial / "nf_start_T_currs.npy", np.stack([np.eye(4), turned]))
    touch = say(trial).touches[1]
    v, u = np.nonzero(mask)
    average = [integrated(k * slopes) * PITCH for k in (1, 2)]
    cloud = np.stack([(u - 19.5) * PITCH, (v - 14.5) * PITCH, average[1][mask]], axis=-1)
    face = np.median(average[0][~mask])
    np.testing.assert_allclose(touch.points, cloud @ turned[:3, :3].T - [0, 0, face], atol=1e-12)


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
