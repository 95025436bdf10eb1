"""JSON file of a calibration: plain numbers, checked when they are read."""

import json
from codecs import BOM_UTF8
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from pcsr.errors import UserError
from pcsr.files import write_text
from pcsr.inputs import read_bytes
from pcsr.limits import MOST_PIXELS
from pcsr.sensors.background import GRID
from pcsr.sensors.figures import Figures
from pcsr.sensors.gels import Gel, check_view
from pcsr.sensors.polynomial import EXPONENTS
from pcsr.validation_messages import described

LARGEST_FILE = 1 << 20
"""Greatest size of the file in bytes."""
LARGEST = 1e3
"""Greatest length in millimetres: side of a pixel, radius of a dome, diameter of a ball."""
LONGEST_NAME = 200
"""Most characters of a sensor's name."""
LARGEST_COEFFICIENT = 1e3
"""Greatest size of a coefficient: changes of colour are of the order of 1, and angles at most 1.4."""

Coefficient = Annotated[float, Field(ge=-LARGEST_COEFFICIENT, le=LARGEST_COEFFICIENT)]
Positive = Annotated[float, Field(gt=0, le=LARGEST)]
NotNegative = Annotated[float, Field(ge=0, le=1e6)]
Side = Annotated[int, Field(ge=8, le=1 << 14)]
Level = Annotated[float, Field(ge=0, le=255)]


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)


class _Gel(_Strict):
    dome: Annotated[tuple[Positive, Positive] | None, Field(strict=False)]
    thickness: Positive | None


class _Figures(_Strict):
    presses: Annotated[int, Field(ge=1)]
    radius_median: NotNegative
    radius_90: NotNegative
    shape: NotNegative
    ball: NotNegative
    cap: float
    cap_spread: NotNegative
    area: NotNegative


class _File(_Strict):
    format: Literal[1]
    sensor: Annotated[str, Field(min_length=1, max_length=LONGEST_NAME)]
    columns: Side
    rows: Side
    mm_per_pixel: Positive
    gel: _Gel
    held_out: _Figures
    background: list[list[Annotated[list[Level], Field(min_length=3, max_length=3)]]]
    coefficients: Annotated[
        list[Annotated[list[Coefficient], Field(min_length=2, max_length=2)]],
        Field(min_length=len(EXPONENTS), max_length=len(EXPONENTS)),
    ]


def write_fields(path: Path, fields: Mapping[str, Any]) -> None:
    """Write the fields of a calibration.

    Raises:
        RunError: the file cannot be written.
    """
    plain = {
        "format": 1,
        "sensor": fields["sensor"],
        "columns": fields["columns"],
        "rows": fields["rows"],
        "mm_per_pixel": fields["mm_per_pixel"],
        "gel": asdict(fields["gel"]),
        "held_out": asdict(fields["figures"]),
        "background": fields["background"].tolist(),
        "coefficients": fields["coefficients"].tolist(),
    }
    lines = ",\n".join(f" {json.dumps(key)}: {json.dumps(value)}" for key, value in plain.items())
    write_text(path, f"{{\n{lines}\n}}\n")


def read_fields(path: Path) -> dict[str, Any]:
    """Read the fields of a calibration.

    Raises:
        UserError: the file does not exist, is no JSON, or holds numbers that no calibration has.
    """
    data = read_bytes(path, most=LARGEST_FILE).removeprefix(BOM_UTF8)  # as editors of Windows write
    try:
        file = _File.model_validate_json(data)
    except ValidationError as error:
        raise UserError(f"{path} is no calibration of a sensor: {_mistake(error)}") from error
    if file.rows * file.columns > MOST_PIXELS:
        raise UserError(f"{path}: images of {file.columns} x {file.rows} pixels have more than {MOST_PIXELS}")
    if not file.sensor.isprintable():
        raise UserError(f"{path}: sensor: the name must have no control characters, got {file.sensor!r}")
    gel = Gel(file.gel.dome, file.gel.thickness)
    try:
        check_view(gel, file.columns, file.rows, file.mm_per_pixel)
    except UserError as error:
        raise UserError(f"{path}: {error}") from error
    background = np.array(file.background) if _is_grid(file.background) else np.zeros(0)
    if background.size == 0 or background.mean() == 0:
        raise UserError(f"{path}: background must be {GRID[0]} rows of {GRID[1]} colours, as calibration writes it")
    return {
        "sensor": file.sensor,
        "gel": gel,
        "columns": file.columns,
        "rows": file.rows,
        "mm_per_pixel": file.mm_per_pixel,
        "coefficients": np.array(file.coefficients),
        "figures": Figures(**file.held_out.model_dump()),
        "background": background,
    }


def _is_grid(background: list[list[list[float]]]) -> bool:
    return len(background) == GRID[0] and all(len(row) == GRID[1] for row in background)


def _mistake(error: ValidationError) -> str:
    """Return the message of the first mistake."""
    first = error.errors(include_url=False)[0]
    if first["type"] == "json_invalid":
        return f"it is no valid JSON: {first['ctx']['error']}"
    path = ".".join(str(key)[:80] for key in first["loc"]) or "the file"
    owner = path.rpartition(".")[0] or "the file"
    nested: dict[str, type[BaseModel]] = {"gel": _Gel, "held_out": _Figures}
    model: type[BaseModel] = next((nested[key] for key in map(str, first["loc"]) if key in nested), _File)
    return described([first], path, owner, model.model_fields)
