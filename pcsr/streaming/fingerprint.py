"""Fingerprint of a command: all that its result depends on."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pcsr import __version__
from pcsr.clouds.convert import convert
from pcsr.clouds.touch import Touch
from pcsr.files import sha256
from pcsr.model import Model, TouchesLike


def command_of(
    model: Model,
    source: Path,
    touches: TouchesLike,
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
    return {
        "version of pcsr": __version__,
        "input": sha256(source),
        "touches": _touches(touches),
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


def _touches(touches: TouchesLike) -> list[str]:
    import hashlib

    if isinstance(touches, str | Path):
        return [sha256(path) for path in sorted(Path(touches).rglob("*")) if path.is_file()]
    clouds = [touch.points if isinstance(touch, Touch) else convert(touch).cloud.points for touch in touches]
    return [hashlib.sha256(np.ascontiguousarray(cloud, np.float64).tobytes()).hexdigest() for cloud in clouds]
