"""Tactile sensors as data: `sensors.toml` holds presets, each figure with its source and its doubt."""

import math
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field

from pcsr import Choice, UserError
from pcsr.errors import did_you_mean

PERSPECTIVE = ("fov", "distance")
"""Figures that only a perspective sensor has."""
ORTHOGRAPHIC = ("width", "height")
"""Figures that follow from others where the sensor is a perspective one."""

MOST_PIXELS = 1 << 20
"""Of a sensor: about so many rays are cast for each try."""


@dataclass(frozen=True)
class Figure:
    """One figure of a preset, as it is shown to people."""

    name: str
    value: Any
    source: str
    doubt: str
    """Empty where there is none."""


@dataclass(frozen=True)
class Sensor:
    """What a sensor sees and how large it is.

    Its frame: the origin is the centre of the unpressed face, x runs along its width, y along its height, and z
    out of the object. The sensor looks along -z. Pixels are square. Lengths are mm.
    """

    name: str
    """The preset's, with " (changed)" where a figure is not."""
    projection: Literal["orthographic", "perspective"]
    width: float
    """Of what is seen, where the face is."""
    height: float
    pixels: tuple[int, int]
    """Columns along the width, rows along the height."""
    housing: tuple[float, float]
    """Sides of the housing along the width and the height."""
    protrusion: float
    """How far the face stands out of the housing."""
    senses: Literal["pressure", "proximity"]
    """pressure: contact is where the object presses into the gel. proximity: the face is rigid, and contact is
    all that is seen within `reach` beyond it."""
    fov: float | None = None
    """Vertical field of view of a perspective sensor, in degrees."""
    distance: float | None = None
    """From the camera of a perspective sensor to the face."""
    dome: tuple[float, float] | None = None
    """Radii of the face along its width and height; None: flat."""
    reach: float | None = None
    """How far a proximity sensor sees beyond its face."""

    @property
    def pitch(self) -> float:
        """Side of a pixel where the face is."""
        return self.width / self.pixels[0]

    @property
    def flat_view(self) -> tuple[float, float] | None:
        """Sides of the part of the gel that is seen, in mm; None for a domed gel, or where no gel is pressed."""
        return None if self.dome is not None or self.senses != "pressure" else (self.width, self.height)


def names() -> list[str]:
    """The presets."""
    return list(_table())


def _known(name: str) -> str:
    if name not in _table():
        raise ValueError(f"there is no sensor '{name}': {did_you_mean(name, _table())}")
    return name


# Limits that no sensor meets: what is beyond them would run on or take all memory.
Side = Annotated[float, Field(ge=0.01, le=1000)]
Length = Annotated[float, Field(gt=0, le=1000)]
Radius = Annotated[float, Field(gt=0, le=1e6)]


class SensorOptions(Choice):
    """A preset of `sensors.toml`, and the figures that replace its own. None keeps the preset's."""

    use: Annotated[str, AfterValidator(_known), Field(json_schema_extra=lambda schema: schema.update(enum=names()))] = (
        "digit"
    )
    projection: Literal["orthographic", "perspective"] | None = None
    """Whether the sensor's rays are parallel or come from one camera."""
    width: Side | None = None
    """Width of what an orthographic sensor sees of the face, in mm."""
    height: Side | None = None
    """Height of the same, in mm."""
    pixels: Annotated[int, Field(ge=1, le=4096)] | None = None
    """Number of pixels along the width; pixels are square."""
    fov: Annotated[float, Field(gt=0, lt=180)] | None = None
    """Vertical field of view of a perspective sensor, in degrees."""
    distance: Length | None = None
    """Distance from a perspective sensor's camera to the face, in mm."""
    dome: tuple[Radius, Radius] | Literal["flat"] | None = None
    """Radii of the face along its width and height, in mm, or flat. A DIGIT: (50, 23)."""
    housing: tuple[Side, Side] | None = None
    """Sides of the housing along the width and the height, in mm."""
    protrusion: Annotated[float, Field(ge=0, le=1000)] | None = None
    """How far the face stands out of the housing, in mm."""
    senses: Literal["pressure", "proximity"] | None = None
    """pressure: contact where the object presses into a gel. proximity: contact within `reach` of a rigid face."""
    reach: Length | None = None
    """Reach of a proximity sensor beyond its face, in mm."""

    def sensor(self) -> Sensor:
        """The preset with its replaced figures.

        Raises:
            UserError: figures that contradict each other.
        """
        return load(self.use, **{name: getattr(self, name) for name in type(self).model_fields if name != "use"})


def figures(name: str) -> list[Figure]:
    """The figures of a preset with their sources and doubts, to be shown.

    Raises:
        UserError: no such preset.
    """
    if name not in _table():
        raise UserError(f"there is no sensor '{name}': {did_you_mean(name, _table())}")
    return [Figure(key, **figure) for key, figure in _table()[name].items()]


def load(name: str, **changes: Any) -> Sensor:
    """A preset, or one with some of its figures changed.

    Args:
        name: of the preset.
        changes: figures by the names of the table; None keeps the preset's. `pixels` is the number along the
            width, as pixels are square; `dome` may be "flat".

    Raises:
        UserError: no such preset, or figures that contradict each other.
    """
    preset = {figure.name: figure.value for figure in figures(name)}
    given = {key: value for key, value in changes.items() if value is not None}
    if not given:
        return Sensor(name, **_complete(preset))
    figure = {**preset, **given}
    if figure["projection"] != preset["projection"] and figure["projection"] == "orthographic":
        # What a camera sees of the face is what parallel rays see of it.
        whole = _complete(preset)
        figure = {"width": whole["width"], "height": whole["height"], **figure}
        figure = {key: value for key, value in figure.items() if key in given or key not in PERSPECTIVE}
    elif figure["projection"] != preset["projection"]:
        figure = {key: value for key, value in figure.items() if key in given or key not in ORTHOGRAPHIC}
    if figure["senses"] == "pressure" and "reach" not in given:
        figure.pop("reach", None)
    if figure.get("dome") == "flat":
        del figure["dome"]
    _check(name, figure)
    columns, rows = preset["pixels"]
    across = given.get("pixels", columns)
    if figure["projection"] == "orthographic":
        rows = max(1, round(figure["height"] / (figure["width"] / across)))
    else:
        rows = max(1, round(across * rows / columns))
    if across * rows > MOST_PIXELS:
        raise UserError(
            f"sensor '{name}': {across} × {rows} pixels are more than {MOST_PIXELS}: lower pixels"
            + (", or height beside width" if figure["projection"] == "orthographic" else "")
        )
    return Sensor(f"{name} (changed)", **_complete({**figure, "pixels": (across, rows)}))


def _complete(figure: dict[str, Any]) -> dict[str, Any]:
    """With the width and height of a perspective sensor."""
    if figure["projection"] == "orthographic":
        return figure
    columns, rows = figure["pixels"]
    height = 2 * figure["distance"] * math.tan(math.radians(figure["fov"]) / 2)
    return {**figure, "width": height * columns / rows, "height": height}


def _check(name: str, figure: dict[str, Any]) -> None:
    """Refuse what contradicts itself, by the option that does."""
    if figure["projection"] == "perspective":
        for key in ORTHOGRAPHIC:
            if key in figure:
                raise UserError(
                    f"sensor '{name}': {key} is {figure[key]}, but what a perspective sensor sees follows from its "
                    f"fov, distance and pixels: leave {key} out"
                )
        for key in PERSPECTIVE:
            if key not in figure:
                raise UserError(f"sensor '{name}': a perspective sensor needs its {key}: give it")
    else:
        for key in PERSPECTIVE:
            if key in figure:
                raise UserError(
                    f"sensor '{name}': {key} is {figure[key]}, but only a perspective sensor has one: "
                    f"leave {key} out, or set projection: perspective"
                )
    if figure["senses"] == "proximity" and "reach" not in figure:
        raise UserError(f"sensor '{name}': a proximity sensor needs its reach in mm: give it")
    if figure["senses"] == "pressure" and "reach" in figure:
        raise UserError(
            f"sensor '{name}': reach is {figure['reach']}, but only a proximity sensor has one: "
            f"leave it out, or set senses: proximity"
        )


@cache
def _table() -> dict[str, dict[str, dict[str, Any]]]:
    text = resources.files("pcsr_plugins.touch.digit").joinpath("sensors.toml").read_text(encoding="utf-8")
    table: dict[str, dict[str, dict[str, Any]]] = tomllib.loads(text)
    for figure in (figure for sensor in table.values() for figure in sensor.values()):
        if isinstance(figure["value"], list):
            figure["value"] = tuple(figure["value"])
    return table
