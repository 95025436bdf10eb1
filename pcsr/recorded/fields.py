"""Base of the strict models of the manifest `touches.json`, and types of its values."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from pcsr.clouds.pose_error import PoseError

UNITS = {"m": 1000.0, "cm": 10.0, "mm": 1.0, "um": 0.001, "in": 25.4}
"""Length of each named unit in mm."""


def _length(value: Any) -> Any:
    """Return the length of a named unit in mm; any other value unchanged."""
    if isinstance(value, str):
        if value not in UNITS:
            raise ValueError(f"unknown unit: use {', '.join(UNITS)}, or the unit's length in mm as a number")
        return UNITS[value]
    return value


Length = Annotated[float, Field(gt=0), BeforeValidator(_length)]
Positive = Annotated[float, Field(gt=0, le=1e12)]
NotNegative = Annotated[float, Field(ge=0)]
Axis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Sign = Literal["positive", "negative"]


class Strict(BaseModel):
    """Immutable model that refuses unknown keys, other types and numbers that are not finite."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class LayoutOptions(Strict):
    """Options of a layout."""

    @property
    def known_pose_error(self) -> PoseError | None:
        """Error of the poses as the authors of the data state it; None if it is unknown."""
        return None
