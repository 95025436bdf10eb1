"""Data that are no recording: what to do with them is said."""

import json

import numpy as np
import pytest
from PIL import Image

from pcsr import UserError
from pcsr.recorded import MANIFEST, read
from tests.recorded.recordings import STILL, reason


def why(folder):
    with pytest.raises(UserError) as caught:
        read(folder)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_camera_images_need_a_manifest_and_a_calibration(tmp_path):
    for number in range(3):
        (tmp_path / f"frame{number}.PNG").write_bytes(b"")
    text = why(tmp_path)
    assert text.startswith(f"{tmp_path} has no touches.json, but 3 files such as frame0.PNG: a recording has one")
    assert "make an entry with the key image and a calibration, see pcsr sensor calibrate" in text
    (tmp_path / "touch.avi").write_bytes(b"")
    assert "of a video save the frame of each touch as PNG" in why(tmp_path)
    assert "a recording is a folder with a touches.json; of a video save" in why(tmp_path / "touch.avi")


@pytest.mark.parametrize(
    ("file", "layout"),
    [
        ("pc_17.pcd", "gsrobotics"),
        ("pointcloud_2.pcd", "gsrobotics"),
        ("gradient_maps.npy", "normalflow"),
        ("synced_data.npy", "ycb-slide"),
        ("tactile_data.pkl", "ycb-slide"),
        ("0/1_ref_frame.npy", "pterotactyl"),
    ],
)
def test_the_files_of_a_layout_are_recognized(tmp_path, file, layout):
    (tmp_path / file).parent.mkdir(exist_ok=True)
    (tmp_path / file).write_bytes(b"")
    (tmp_path / "a.png").write_bytes(b"")
    assert f"has no touches.json, and its files look like those of the layout {layout}: write one" in why(tmp_path)


def test_other_folders_only_lack_a_manifest(tmp_path):
    (tmp_path / "scan.ply").write_bytes(b"")
    assert "touches.json cannot be read: No such file or directory" in why(tmp_path)
    assert "cannot be read" in why(tmp_path / "nowhere")
    assert why(tmp_path / "scan.ply").endswith("scan.ply is a file: a recording is a folder with a touches.json")


@pytest.mark.parametrize(
    ("name", "remedy"),
    [
        ("digit", "pcsr sensor calibrate"),
        ("GelSight", "pcsr sensor calibrate"),
        ("gelslim", "pcsr sensor calibrate"),
        ("gs_sdk", 'entries with the key height and "integration": "gs_sdk"'),
        ("smith-2021", "did you mean 'smith-2020'?"),
    ],
)
def test_names_of_sensors_are_no_layouts(tmp_path, name, remedy):
    (tmp_path / MANIFEST).write_text(json.dumps({"format": 1, "layout": {"name": name}}))
    text = why(tmp_path)
    assert f"layout.name: no layout '{name}': " in text
    assert remedy in text


def test_camera_images_and_videos_are_no_heights(tmp_path):
    height = {"mm_per_level": 1, "mm_per_pixel": 0.1, "indentation": "positive", "pose": STILL}
    Image.new("RGB", (4, 3)).save(tmp_path / "a.png")
    Image.new("P", (4, 3)).save(tmp_path / "b.png")
    np.save(tmp_path / "a.npy", np.zeros((4, 3, 3)))
    for name in ("a.png", "a.npy"):
        assert "make an entry with the key image and a calibration" in reason(tmp_path, height | {"height": name})
    assert "calibration" not in reason(tmp_path, height | {"height": "b.png"})
    text = reason(tmp_path, height | {"height": "a.mp4"})
    assert "a.mp4 is a video: save the frame of each touch as PNG, and name that" in text
