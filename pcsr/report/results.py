"""What a run folder holds, read and checked."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from pydantic import BaseModel, Field, FiniteFloat, ValidationError, model_validator
from safetensors import SafetensorError, safe_open

from pcsr.errors import UserError
from pcsr.metrics.touch_effect import efficiency
from pcsr.validation_messages import explained

Cloud = Float[np.ndarray, "_ 3"]
BOUND = "floor"
"""The baseline that cannot be reached: it is never the best, and does not decide how many digits are shown."""


class Data(BaseModel):
    """What was compared."""

    shapes: str
    split: str
    points: int
    truth: int
    rate: int
    touches: int
    sampling: str
    seed: int | None = None
    """Of the objects' clouds; None in results of old."""
    normalisation: str
    coverage: float | None = None
    """Part of the truth that the touches felt, 0 to 1."""
    object_size: float | None = None
    """Millimetres."""
    left_out: int = 0


class MetricNote(BaseModel):
    """How a metric is shown: its value times `scale`."""

    description: str
    scale: float


class MethodResult(BaseModel):
    """What one method reached: `values[metric]` has one number for each object."""

    name: str
    parameters: int
    seconds: float
    values: dict[str, list[FiniteFloat]]


class TouchResult(BaseModel):
    """What touch does to the recipe's own network; the fields of `TouchEffect`."""

    touched: list[FiniteFloat]
    plain: list[FiniteFloat]
    replaced: list[FiniteFloat]
    seconds: float
    edges: list[FiniteFloat]
    counts: list[int]
    errors: dict[str, list[FiniteFloat | None]]

    @property
    def efficiency(self) -> float | None:
        """Over all objects; None where the felt region holds no error."""
        return efficiency(self.touched, self.plain, self.replaced)

    @model_validator(mode="after")
    def _one_number_each(self) -> "TouchResult":
        sizes = {"counts": len(self.counts), **{name: len(row) for name, row in self.errors.items()}}
        for key, found in sizes.items():
            if found != len(self.edges):
                raise ValueError(f"'{key}' has {found} values for {len(self.edges)} distances")
        return self


class Training(BaseModel):
    """Where the weights came from; what isn't known is absent."""

    source: str = "of unknown source"
    steps: int | None = None
    seconds: float | None = None
    device: str | None = None
    threads: int | None = None
    other_code: str | None = None
    """Of weights that were measured with other code of a part than that of their training: what it is, in words."""


class Results(BaseModel):
    """`results.json`. The first method is the recipe's own, the second the baseline that wins are counted against."""

    name: str
    fingerprint: str
    seed: int
    version: str
    recipe: dict[str, Any]
    data: Data
    metrics: dict[str, MetricNote] = Field(min_length=1)
    objects: list[str] = Field(min_length=1)
    groups: list[str]
    methods: list[MethodResult] = Field(min_length=1)
    touch: TouchResult | None = None
    """None where there are no touches, and in results of old."""
    training: Training = Training()
    timing: str = "mean"
    """Which average of a method's times its `seconds` are; the mean in results of 0.1."""
    hardware: dict[str, Any] = {}
    created: str

    @property
    def baseline(self) -> str | None:
        """The method that the others are held against; None if there is only one."""
        return self.methods[1].name if len(self.methods) > 1 else None

    @property
    def timed(self) -> str:
        """What a method's `seconds` are, and of which machine."""
        return f"{self.timing} wall time for one cloud{f' ({self.machine})' if self.machine else ''}"

    @property
    def machine(self) -> str:
        """Where and how busy, in words."""
        return ", ".join(
            f"{key} {f'{value:.1f}' if isinstance(value, float) else value}"
            for key, value in self.hardware.items()
            if value is not None
        )

    @model_validator(mode="after")
    def _one_number_each(self) -> "Results":
        if len(self.groups) != len(self.objects):
            raise ValueError(f"{len(self.objects)} objects but {len(self.groups)} groups")
        for method in self.methods:
            for metric in self.metrics:
                found = len(method.values.get(metric, ()))
                if found != len(self.objects):
                    raise ValueError(f"'{method.name}' has {found} values of {metric} for {len(self.objects)} objects")
        if self.touch is not None:
            for key in ("touched", "plain", "replaced"):
                if (found := len(getattr(self.touch, key))) != len(self.objects):
                    raise ValueError(f"touch.{key} has {found} values for {len(self.objects)} objects")
        return self


@dataclass(frozen=True)
class Example:
    """The clouds of one object, in one frame."""

    name: str
    input: Cloud
    touches: Cloud | None
    truth: Cloud
    predictions: dict[str, Cloud]


def parse_results(data: dict[str, Any], source: str = "the results") -> Results:
    """Check results read from JSON.

    Raises:
        UserError: a key is missing or of the wrong kind, or a method lacks values.
    """
    try:
        return Results.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(map(str, first["loc"]))
        where = f"{place}: " if place else ""
        raise UserError(f"{source}: {where}{explained([first])}; do `pcsr run` again") from error


def read_results(path: Path) -> Results:
    """Read `results.json`.

    Raises:
        UserError: the file is missing or malformed.
    """
    try:
        data = json.loads(_text(path))
    except json.JSONDecodeError as error:
        raise UserError(f"{path}:{error.lineno}: {error.msg}; do `pcsr run` again") from error
    except RecursionError as error:
        raise UserError(f"{path}: nested too deeply; do `pcsr run` again") from error
    if not isinstance(data, dict):
        raise UserError(f"{path}: not a JSON object; do `pcsr run` again")
    return parse_results(data, str(path))


def read_history(path: Path) -> list[dict[str, Any]] | None:
    """Read `metrics.jsonl`; None if there is none, since ready-trained weights have no history here.

    Raises:
        UserError: a line is malformed.
    """
    if not path.exists():
        return None
    history = []
    for number, line in enumerate(_text(path).splitlines(), 1):
        try:
            entry = json.loads(line)
            step = entry["step"]
            numbers = [step, *([entry["loss"]] if "validation" not in entry else entry["validation"].values())]
            if not all(math.isfinite(number) for number in (*numbers, *entry.get("losses", {}).values())):
                raise ValueError("not finite")
        except (ValueError, AttributeError, KeyError, TypeError, RecursionError) as error:
            raise UserError(f"{path}:{number}: not a line of a training history; do `pcsr run` again") from error
        history.append(entry)
    return history


def read_examples(path: Path, methods: Sequence[str]) -> list[Example]:
    """Read `examples.safetensors`.

    Raises:
        UserError: the file is missing or malformed, or lacks a cloud.
    """
    if not path.is_file():
        raise UserError(f"{path} is missing; do `pcsr run` again")
    try:
        with safe_open(path, framework="numpy") as file:
            names = json.loads(file.metadata()["names"])
            clouds = {key: file.get_tensor(key) for key in file.keys()}  # noqa: SIM118 (not a dict)
        for key, cloud in clouds.items():
            if cloud.ndim != 2 or cloud.shape[1] != 3 or not len(cloud) or not np.isfinite(cloud).all():
                raise ValueError(f"{key} of shape {cloud.shape} is no cloud of finite points")
        return [
            Example(
                name,
                clouds[f"{k}/input"],
                clouds.get(f"{k}/touches"),
                clouds[f"{k}/truth"],
                {method: clouds[f"{k}/{method}"] for method in methods},
            )
            for k, name in enumerate(names)
        ]
    except KeyError as error:
        raise UserError(f"{path} lacks {error}; do `pcsr run` again") from error
    except (SafetensorError, OSError, TypeError, ValueError) as error:
        raise UserError(f"{path} is no file of examples: {error}; do `pcsr run` again") from error


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise UserError(f"{path} is missing; do `pcsr run` again") from error
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path} can't be read: {error}; do `pcsr run` again") from error
