"""Writing of touches as a recording, without loss of a bit."""

from collections.abc import Sequence
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.formats import cloud_bytes
from pcsr.clouds.pose_error import PoseError
from pcsr.clouds.touch import Touch
from pcsr.errors import UserError
from pcsr.recorded.fingers import ERROR
from pcsr.recorded.folder import check_free, manifest_text, write_folder
from pcsr.recorded.pose import check_matrix


def write(
    folder: Path,
    touches: Sequence[Touch],
    names: Sequence[str] | None = None,
    *,
    overwrite: bool = False,
    pose_error: PoseError | None = None,
) -> None:
    """Write touches of one object as a recording, from which `read` returns the same touches to the last bit.

    The manifest is written last, so that a folder without one is not finished.

    Args:
        folder: folder to write to; it need not exist.
        touches: touches with the same unit.
        names: name of each touch.
        overwrite: replace the recording in the folder.
        pose_error: error of the poses; None if it is unknown.

    Raises:
        UserError: the folder holds a recording already, a file that does not belong to one would be overwritten, or a
            touch cannot be represented.
        RunError: a file cannot be written.

    Examples:
        >>> touch = pcsr.Touch.single(np.zeros((20, 3)), None, unit=1.0, sensor="digit")
        >>> pcsr.recorded.write(Path("touches"), [touch], names=["front"])
        >>> sorted(path.name for path in Path("touches").iterdir())
        ['0.ply', 'touches.json']
    """
    check_free(folder, overwrite=overwrite)
    units = sorted({float(touch.unit) for touch in touches})
    if len(units) != 1:
        raise UserError(f"{folder}: the touches of a recording must have the same unit, got units of {units} mm")
    if names is not None and len(names) != len(touches):
        raise UserError(f"{folder}: {len(names)} names for {len(touches)} touches: give one for each")
    clouds: dict[str, Cloud | np.ndarray] = {}
    entries = [_entry(touch, str(index), clouds) for index, touch in enumerate(touches)]
    for index, (entry, touch) in enumerate(zip(entries, touches, strict=True)):
        entry |= {} if names is None else {"name": names[index]}
        entry |= {} if touch.sensor == touches[0].sensor else {"sensor": touch.sensor}
    head: dict[str, Any] = {
        "format": 1,
        "unit": "mm",
        "object_unit": units[0],
        "frame": "object",
        "sensor": touches[0].sensor,
    }
    files = {file: partial(_content, data) for file, data in clouds.items()}
    write_folder(folder, manifest_text(head, entries, pose_error), files, overwrite=overwrite)


def _entry(touch: Touch, stem: str, clouds: dict[str, Cloud | np.ndarray]) -> dict[str, Any]:
    """Return the manifest's entry of a touch, and add the arrays of its files to `clouds`."""
    fingers = max(len(touch.poses), int(touch.finger.max(initial=0)) + 1)
    if len(touch.poses) not in (0, fingers) or len(touch.points) == 0 or not np.isfinite(touch.points).all():
        raise UserError(
            f"touch {stem} by '{touch.sensor}' cannot be recorded: it has {len(touch.points)} points of {fingers} "
            f"fingers and {len(touch.poses)} poses: it needs finite points, and a pose for all fingers or for none"
        )
    area: dict[str, Any] = {} if touch.contact_area is None else {"contact_area": float(touch.contact_area)}
    if area and not 0 <= area["contact_area"] < np.inf:
        raise UserError(
            f"touch {stem} by '{touch.sensor}' cannot be recorded: its contact area is {touch.contact_area}"
        )
    order = np.argsort(touch.finger, kind="stable")
    parts: list[dict[str, Any]] = []
    for finger in range(fingers):
        own = touch.subset(touch.finger == finger)
        file = f"{stem}.ply" if fingers == 1 else f"{stem}_{finger}.ply"
        if len(own.points):
            clouds[file] = Cloud(np.array(own.points, np.float64), {} if own.errors is None else {ERROR: own.errors})
        part: dict[str, Any] = {"cloud": file if len(own.points) else None, "unit": float(touch.unit)}
        if touch.view is not None:
            part["view"] = [float(side) for side in touch.view]
        if len(touch.poses):
            pose = check_matrix(touch.poses[finger], 1 / touch.unit, f"touch {stem}: pose {finger}")
            part["pose"] = {"matrix": pose.tolist(), "maps_to": "object_unit"}
        parts.append(part)
    if fingers == 1:
        return parts[0] | area
    if (np.diff(touch.finger) >= 0).all():
        return {"fingers": parts} | area
    clouds[f"{stem}_order.npy"] = np.argsort(order)
    return {"fingers": parts, "order": f"{stem}_order.npy"} | area


def _content(data: Cloud | np.ndarray) -> bytes:
    """Return the content of a data file: a PLY with points, or an NPY with an array."""
    if isinstance(data, Cloud):
        return cloud_bytes(data, ".ply")
    content = BytesIO()
    np.save(content, data, allow_pickle=False)
    return content.getvalue()
