"""Fingerprint of a command: all that its result depends on."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pcsr import __version__
from pcsr.clouds.touch import Touch
from pcsr.files import sha256
from pcsr.model import Model
from pcsr.tensors import CloudArray
from pcsr.touches import GivenTouches


def command_of(
    model: Model,
    source: Path,
    touches: GivenTouches,
    *,
    rate: float | int | None,
    count: int | None,
    keep: bool,
    fields: Sequence[str],
    bad: str,
    tile: int,
) -> dict[str, Any]:
    """Return all that the result of `upsample_file` depends on, by the words for it in messages; JSON values.

    Files count by their content. The number of processes and the scheduler are not part of it.
    """
    error = touches.pose_error
    return {
        "version of pcsr": __version__,
        "input": sha256(source),
        "touches": [_digest(touch) for touch in touches.touches],
        "--pose-error": None if error is None else [error.position, error.rotation],
        "--touch-as-is": touches.as_is,
        "model": sha256(model.path) if model.path else model.name,
        "plugins": [sha256(path) for path in model.plugins],
        "device": "cpu" if model.network is None else next(model.network.parameters()).device.type,
        "--rate": None if rate is None else float(rate),
        "--points": count,
        "--replace": not keep,
        "--fields": list(fields),
        "--bad": bad,
        "tiles": tile,
    }


def _digest(touch: Touch | CloudArray) -> str:
    points = touch.points if isinstance(touch, Touch) else touch
    parts = [points] if not isinstance(touch, Touch) else [points, touch.poses, touch.finger, np.array(touch.unit)]
    arrays = (np.ascontiguousarray(part, np.float64).tobytes() for part in parts)
    return hashlib.sha256(b"".join(arrays)).hexdigest()
