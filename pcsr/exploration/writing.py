"""Files of poses to touch: JSON for programs and robots, and PLY to look at."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes
from pcsr.errors import UserError
from pcsr.exploration.choosing import NextTouch, NextTouches
from pcsr.files import write_bytes, write_text

SUFFIXES = (".json", ".ply")
"""Suffixes of the files that can be written."""
METRE = 1000.0
"""Length of a metre in mm, the unit of ROS."""


def write_next(path: Path, found: NextTouches, frame: str = "object") -> None:
    """Write poses to a file.

    Args:
        path: `.json` or `.ply`.
        found: result of `pcsr.next_touches`.
        frame: name of the cloud's frame, as `header.frame_id` of ROS.

    Raises:
        UserError: the suffix is neither, or there is no pose for a `.ply` file.
        RunError: the file cannot be written.
    """
    check_suffix(path)
    if path.suffix.lower() == ".json":
        write_text(path, json.dumps(as_json(found, frame), indent=1) + "\n")
    elif len(found) == 0:
        raise UserError(f"{path}: a .ply file needs a pose, and there is none: {found.reason}")
    else:
        write_bytes(path, cloud_bytes(as_cloud(found), ".ply"))


def check_suffix(path: Path) -> None:
    """Check that poses can be written to a path.

    Raises:
        UserError: its suffix is neither `.json` nor `.ply`.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise UserError(f"{path}: poses are written as {' or '.join(SUFFIXES)}: name such a file")


def as_json(found: NextTouches, frame: str = "object") -> dict[str, Any]:
    """Return the poses as plain data.

    `pose` of each touch is what `touches.json` of a recording takes; `ros` is a `geometry_msgs/PoseStamped`.
    """
    return {
        "format": 1,
        "object_unit": found.unit,
        "sensor": found.fingertip.name,
        "error_mm2": found.error,
        "towards_camera": None if found.towards is None else found.towards.tolist(),
        "reason": found.reason,
        "touches": [_entry(touch, index, found.unit, frame) for index, touch in enumerate(found)],
    }


def _entry(touch: NextTouch, index: int, unit: float, frame: str) -> dict[str, Any]:
    rotation = touch.pose[:3, :3] * unit
    quaternion = Rotation.from_matrix(rotation).as_quat().tolist()
    position = (touch.pose[:3, 3] * unit / METRE).tolist()
    return {
        "name": str(index),
        "pose": {"matrix": touch.pose.tolist(), "maps_to": "object_unit"},
        "approach": (-rotation[:, 2]).tolist(),
        "gain_mm2": touch.gain,
        "gain_percent": None if touch.share is None else 100 * touch.share,
        "contact_mm2": touch.contact_area,
        "guessed": touch.guessed,
        "ros": {
            "header": {"frame_id": frame},
            "pose": {
                "position": dict(zip("xyz", position, strict=True)),
                "orientation": dict(zip("xyzw", quaternion, strict=True)),
            },
        },
    }


def as_cloud(found: NextTouches) -> Cloud:
    """Return the poses as a cloud: positions, normals that point away from the object, gains and contacts."""
    poses = np.array([touch.pose for touch in found]).reshape(-1, 4, 4)
    normals = poses[:, :3, 2] * found.unit
    gains = np.array([np.nan if touch.gain is None else touch.gain for touch in found], np.float64)
    shares = np.array([np.nan if touch.share is None else 100 * touch.share for touch in found], np.float64)
    columns: dict[str, np.ndarray] = {
        **{name: normals[:, k] for k, name in enumerate(("nx", "ny", "nz"))},
        "gain_mm2": gains,
        "gain_percent": shares,
        "contact_mm2": np.array([touch.contact_area for touch in found], np.float64),
        "guessed": np.array([touch.guessed for touch in found], np.uint8),
    }
    return Cloud(np.ascontiguousarray(poses[:, :3, 3]), columns)
