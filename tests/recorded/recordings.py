"""Recordings of a few touches."""

import json

import numpy as np

from pcsr import Touch
from pcsr.clouds.formats import write_points
from pcsr.recorded import MANIFEST, read

HEAD = {"format": 1, "unit": "mm", "object_unit": "m", "frame": "sensor", "sensor": "digit"}
STILL = {"translation": [0, 0, 0], "quaternion": [0, 0, 0, 1], "order": "xyzw"}
CLOUD = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])


def record(folder, *touches, **head):
    folder.mkdir(exist_ok=True)
    (folder / MANIFEST).write_text(json.dumps({**HEAD, "touches": list(touches), **head}))
    return folder


def only(folder, *touches, **head):
    recording = read(record(folder, *touches, **head))
    assert not recording.skipped
    assert len(recording.touches) == 1
    return recording.touches[0]


def reason(folder, touch, **head):
    """Why one touch is left out, beside a good one that is not."""
    write_points(folder / "good.ply", CLOUD)
    good = {"cloud": "good.ply", "pose": STILL}
    recording = read(record(folder, good, touch, good | {"name": "again"}, **head))
    assert recording.names == ["good.ply", "again"]
    (text,) = recording.skipped.values()
    assert "\n" not in text
    return text


def one_touch(**changes):
    fields = {"points": CLOUD, "finger": np.zeros(2, np.int64), "poses": np.eye(4)[None], "unit": 1.0, "sensor": "x"}
    return Touch(**{**fields, "contact_area": None, **changes})
