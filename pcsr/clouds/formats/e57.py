"""Reader of E57, the exchange format of terrestrial laser scanners, by pye57 (extra `[e57]`)."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from pcsr.clouds.cloud import Cloud
from pcsr.clouds.columns import NORMALS
from pcsr.errors import UserError
from pcsr.extras import imported
from pcsr.limits import check_inflated

USER = "the format E57"
"""Feature that needs pye57, for the message if it is not installed."""
CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
INVALID = ("cartesianInvalidState", "sphericalInvalidState")
"""Fields that are not 0 where a laser pulse gave no point."""
COLOURS = {"colorRed": "red", "colorGreen": "green", "colorBlue": "blue"}
DIRECTIONS = dict(zip(("nor:normalX", "nor:normalY", "nor:normalZ"), NORMALS, strict=True))
KEPT = {"intensity": "intensity", **COLOURS, **DIRECTIONS}
"""Fields that become columns, and the names of these."""
DAMAGED = "it is damaged, or not all of it is there: get the file again"


def read(data: bytes) -> Cloud:
    """Read all scans of a file in its common frame, with colours, intensities and normals that all scans have.

    Points that are marked as invalid are dropped, with a note.

    Raises:
        UserError: the file is damaged or has no points, or the extra `[e57]` is not installed.
    """
    pye57 = imported("pye57", USER)
    with tempfile.TemporaryDirectory() as folder:  # pye57 reads files by their path alone
        path = Path(folder) / "scan.e57"
        path.write_bytes(data)
        try:
            with pye57.E57(str(path)) as file:
                scans = list(_scans(pye57, file, len(data)))
        except (pye57.libe57.E57Exception, RuntimeError, ValueError, TypeError, IndexError) as error:
            raise UserError(DAMAGED) from error
    if not scans:
        raise UserError("it holds no points")
    return _merged(scans)


def _scans(pye57: Any, file: Any, size: int) -> Iterator[tuple[Cloud, int]]:
    """Yield each scan that has points, and the number of its invalid points; `size` is that of the file in bytes."""
    for number in range(file.scan_count):
        header = file.get_header(number)
        count, fields = int(header.point_count), list(header.point_fields)
        system = next((one for one in (CARTESIAN, SPHERICAL) if set(one) <= set(fields)), None)
        if system is None:
            raise UserError(f"scan {number} has no coordinates, only the fields {', '.join(fields)[:200]}")
        if not count:
            continue
        wanted = [name for name in fields if name in (*system, *KEPT, *INVALID)]
        check_inflated(size, count * 8 * len(wanted))
        table = _table(pye57, file, header, wanted, count)
        xyz = np.stack([table[name] for name in system], axis=-1)
        xyz = _from_spherical(xyz) if system is SPHERICAL else xyz
        rotation, shift = header.rotation_matrix, np.asarray(header.translation, np.float64)
        directions = [name for name in DIRECTIONS if name in table]
        if len(directions) == len(DIRECTIONS):
            turned = np.stack([table[name] for name in directions], axis=-1) @ rotation.T
            table |= dict(zip(directions, np.ascontiguousarray(turned.T), strict=True))
        valid = np.ones(count, bool)
        for name in INVALID:
            valid &= table.get(name, np.zeros(1)) == 0
        columns = {KEPT[name]: column for name, column in table.items() if name in KEPT}
        if columns.keys() >= set(COLOURS.values()):
            columns |= _colours(header, columns)
        left_out = [name for name in fields if name not in wanted and name not in (*CARTESIAN, *SPHERICAL)]
        about = {"notes": (), "left out": left_out}
        cloud = Cloud(np.ascontiguousarray(xyz @ rotation.T + shift), columns, about)
        yield cloud.chosen(valid), count - int(valid.sum())


def _table(pye57: Any, file: Any, header: Any, names: list[str], count: int) -> dict[str, np.ndarray]:
    """Return fields of a scan by name, in double precision."""
    table = {name: np.zeros(count) for name in names}
    buffers = pye57.libe57.VectorSourceDestBuffer()
    for name, column in table.items():
        buffers.append(pye57.libe57.SourceDestBuffer(file.image_file, name, column, count, True, True))
    if header.points.reader(buffers).read() != count:
        raise UserError(DAMAGED)
    return table


def _from_spherical(points: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
    """Convert ranges, azimuths and elevations to coordinates."""
    distance, azimuth, elevation = points.T
    level = distance * np.cos(elevation)
    return np.stack([level * np.cos(azimuth), level * np.sin(azimuth), distance * np.sin(elevation)], axis=-1)


def _colours(header: Any, columns: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return colours in 8 bits, or in 16 if the scan has more than 8; its limits say what full brightness is."""
    found: dict[str, np.ndarray] = {}
    for field, name in COLOURS.items():
        low, high = 0.0, 255.0 if columns[name].max(initial=0) <= 255 else 65535.0
        if header.node.isDefined("colorLimits") and header["colorLimits"].isDefined(f"{field}Maximum"):
            low, high = (float(header["colorLimits"][f"{field}{end}"].value()) for end in ("Minimum", "Maximum"))
        share = ((columns[name] - low) / (high - low if high > low else 1.0)).clip(0, 1)
        kind = np.uint8 if high <= 255 else np.uint16
        found[name] = np.rint(share * np.iinfo(kind).max).astype(kind)
    return found


def _merged(scans: list[tuple[Cloud, int]]) -> Cloud:
    clouds = [cloud for cloud, _ in scans]
    notes: list[str] = []
    invalid = sum(count for _, count in scans)
    if invalid:
        notes.append(
            f"{invalid} of its {sum(map(len, clouds)) + invalid} points are marked as invalid and were dropped"
        )
    if len(clouds) > 1:
        notes.append(f"its {len(clouds)} scans were put together in the frame of the file")
    names = [name for name in clouds[0].columns if all(name in cloud.columns for cloud in clouds)]
    partial = sorted({name for cloud in clouds for name in cloud.columns} - set(names))
    left_out = sorted({name for cloud in clouds for name in cloud.about["left out"]})
    if partial:
        notes.append(f"its fields {', '.join(partial)} were left out, since only some of its scans have them")
    if left_out:
        notes.append(f"its fields {', '.join(left_out)[:200]} were left out, since pcsr does not read them")
    kinds = {name: np.result_type(*(cloud.columns[name].dtype for cloud in clouds)) for name in names}
    columns = {name: np.concatenate([_as(cloud.columns[name], kinds[name]) for cloud in clouds]) for name in names}
    return Cloud(np.concatenate([cloud.points for cloud in clouds]), columns, {"notes": tuple(notes)})


def _as(column: np.ndarray, kind: np.dtype[Any]) -> np.ndarray:
    """Convert a column; 8-bit colours beside 16-bit ones are scaled."""
    wider = column.dtype == np.uint8 and kind == np.uint16
    return column.astype(kind) * np.uint16(257) if wider else column
