"""Results of an evaluation: the schema of `results.json`, filled by the evaluation and read by the report."""

import json
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import AliasPath, BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from pcsr.counted import counted
from pcsr.errors import UserError
from pcsr.files import write_text
from pcsr.metrics.touch_effect import TouchEffect
from pcsr.validation_messages import explained

BOUND = "floor"
"""Name of the baseline that samples the true surface: never the best of a column, and not used to choose decimals."""
RERUN = "do `pcsr run` again"

Record = TypeVar("Record", bound=BaseModel)


class Data(BaseModel):
    """Clouds on which methods were compared."""

    shapes: str
    split: str
    points: int
    truth: int
    rate: int
    touches: int
    sampling: str
    seed: int | None = None
    """Seed of the clouds; None in results of pcsr 0.1.0."""
    normalisation: str
    object_size: int | float | None = None
    """Longest side of an object, in mm."""
    coverage: float | None = None
    """Fraction of the true points that were touched, 0 to 1."""
    left_out: int = 0
    """Objects that were rejected as unusable."""
    fingerprint: str | None = None
    radii: list[FiniteFloat] | None = None
    """Root mean square distance of each sparse cloud's points from their mean, in radii of the truth's bounding sphere.
    Runs on the same clouds have the same radii, but for rounding. None in results of pcsr 0.2 and older."""


class MetricNote(BaseModel):
    """Description of a metric, and the factor by which its values are multiplied for display."""

    description: str
    scale: int | float


class MethodResult(BaseModel):
    """Result of one method: `values[metric]` has one number for each object."""

    name: str
    parameters: int
    seconds: float
    """Wall time for one cloud; `Results.timing` names the average."""
    values: dict[str, list[Annotated[FiniteFloat, Field(gt=-1e100, lt=1e100)]]]


class Training(BaseModel):
    """Origin of the weights. Keys that the weights' card has beyond these are kept."""

    model_config = ConfigDict(extra="allow")

    seconds: int | float | None = None
    steps: int | None = None
    epochs: float | None = None
    """Number of epochs that were trained, fewer than the recipe's after early stopping; None in older results."""
    best_step: int | None = None
    """Step of the weights that early stopping kept."""
    weights: str | None = None
    """SHA-256 hash of the weights, as in their card; None in results of pcsr 0.2 and older."""
    device: str | None = None
    threads: int | None = None
    validation: dict[str, Any] | None = None
    """Validated metrics at the end of the training."""
    source: str = "of unknown source"
    other_code: str | None = None
    """How the code of the parts differs from the code that trained the weights; None if it does not."""


class RecipeSettings(BaseModel):
    """Settings of a recipe that reports read."""

    epochs: int | None = Field(None, ge=1, validation_alias=AliasPath("train", "epochs"))
    published: dict[str, float] = Field({}, validation_alias=AliasPath("evaluate", "published"))
    """Published values, by metric or column."""


class Results(BaseModel):
    """Content of `results.json`.

    The first method is the recipe's own network, the second the baseline that wins are counted against. A field that
    is not set is not written.
    """

    name: Annotated[str, Field(pattern=r"^[^\x00-\x1f\x7f]{1,200}$")]
    """Name of the recipe; printable, since tables show it."""
    fingerprint: str
    seed: int
    version: str
    recipe: dict[str, Any]
    data: Data
    metrics: dict[str, MetricNote] = Field(min_length=1)
    objects: list[str] = Field(min_length=1)
    groups: list[str]
    methods: list[MethodResult] = Field(min_length=1)
    touch: TouchEffect | None = None
    """None without touches, and in results of pcsr 0.1.0."""
    training: Training = Training()
    protocol: str | None = None
    """Name of the way in which the network makes a cloud dense; None in results of pcsr 0.2 and older."""
    timing: str = "mean"
    """Average that `MethodResult.seconds` are: the mean in results of pcsr 0.1.0, else the median."""
    hardware: dict[str, Any] = {}
    code: str | None = None
    """Hash of the code of pcsr; None in results of pcsr 0.2 and older."""
    created: str

    @property
    def folder_name(self) -> str:
        """Name of the run folder."""
        return f"{self.name}-{self.fingerprint[:8]}"

    @property
    def baseline(self) -> str | None:
        """Name of the method that the others are compared with; None if there is only one method."""
        return self.methods[1].name if len(self.methods) > 1 else None

    @property
    def settings(self) -> RecipeSettings:
        """Settings of the recipe that reports read."""
        return RecipeSettings.model_validate(self.recipe)

    @property
    def budget(self) -> list[str]:
        """Length of the training, such as ``["12 of 16 epochs", "96 steps", "weights of step 16"]``."""
        training, epochs = self.training, self.settings.epochs
        found = []
        if epochs is not None:
            stopped = training.epochs is not None and training.epochs < epochs
            found.append(f"{training.epochs:g} of {epochs} epochs" if stopped else counted(epochs, "epoch"))
        if training.steps is not None:
            found.append(counted(training.steps, "step"))
        if training.best_step is not None:
            found.append(f"weights of step {training.best_step}")
        return found

    @property
    def seconds_per_epoch(self) -> float | None:
        """Wall time of one epoch of the training; None where the weights' card has no time."""
        seconds, epochs = self.training.seconds, self.training.epochs or self.settings.epochs
        return None if seconds is None or epochs is None else seconds / epochs

    @property
    def timed(self) -> str:
        """Description of `MethodResult.seconds`, with the machine."""
        return f"{self.timing} wall time for one cloud{f' ({self.machine})' if self.machine else ''}"

    @property
    def machine(self) -> str:
        """Hardware and load, as text."""
        return ", ".join(
            f"{key} {f'{value:.1f}' if isinstance(value, float) else value}"
            for key, value in self.hardware.items()
            if value is not None
        )

    @model_validator(mode="after")
    def _check_recipe(self) -> "Results":
        try:
            settings = self.settings
        except ValidationError as error:
            raise ValueError(f"recipe.{_first_mistake(error)}") from error
        if self.training.seconds is not None and settings.epochs is None:
            raise ValueError("recipe.train.epochs is missing, by which training.seconds is divided")
        return self

    @model_validator(mode="after")
    def _check_lengths(self) -> "Results":
        if len(self.groups) != len(self.objects):
            raise ValueError(f"{len(self.objects)} objects but {len(self.groups)} groups")
        for method in self.methods:
            for metric in self.metrics:
                found = len(method.values.get(metric, ()))
                if found != len(self.objects):
                    raise ValueError(f"'{method.name}' has {found} values of {metric} for {len(self.objects)} objects")
        if self.touch is not None:
            for key in ("touched", "plain", "replaced", "exchanged"):
                values = getattr(self.touch, key)
                if values is not None and len(values) != len(self.objects):
                    raise ValueError(f"touch.{key} has {len(values)} values for {len(self.objects)} objects")
        if self.data.radii is not None and len(self.data.radii) != len(self.objects):
            raise ValueError(f"data.radii has {len(self.data.radii)} values for {len(self.objects)} objects")
        return self


def validated(model: type[Record], data: object, source: str, remedy: str) -> Record:
    """Validate data against a model of this file.

    Args:
        model: a class of this file.
        data: nested dicts, as JSON gives them.
        source: where the data come from, for the message.
        remedy: what to do about a mistake.

    Raises:
        UserError: a key is missing or of the wrong type, or lists differ in length.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise UserError(f"{source}: {_first_mistake(error)}; {remedy}") from error


def _first_mistake(error: ValidationError) -> str:
    first = error.errors(include_url=False)[0]
    where = ".".join(map(str, first["loc"]))
    return f"{where}: {explained([first])}" if where else explained([first])


def parse_results(data: object, source: str = "the results") -> Results:
    """Validate results that were read from JSON.

    Raises:
        UserError: a key is missing or of the wrong type, or a method lacks values.
    """
    return validated(Results, data, source, RERUN)


def read_results(path: Path) -> Results:
    """Read `results.json` of a finished run.

    Raises:
        UserError: the file is missing or malformed.
    """
    return parse_results(read_object(path), str(path))


def write_results(path: Path, results: Results) -> None:
    """Write `results.json`, whole or not at all.

    Raises:
        RunError: the file can't be written.
    """
    write_text(path, json.dumps(results.model_dump(exclude_unset=True), indent=1))


def read_object(path: Path) -> dict[str, Any]:
    """Read a JSON object from a file of a run folder.

    Raises:
        UserError: the file is missing, can't be read or is not a JSON object.
    """
    try:
        data = json.loads(read_text(path))
    except json.JSONDecodeError as error:
        raise UserError(f"{path}:{error.lineno}: {error.msg}; {RERUN}") from error
    except RecursionError as error:
        raise UserError(f"{path}: nested too deeply; {RERUN}") from error
    except ValueError as error:
        raise UserError(f"{path}: a number has too many digits; {RERUN}") from error
    if not isinstance(data, dict):
        raise UserError(f"{path}: not a JSON object; {RERUN}")
    return data


def read_text(path: Path) -> str:
    """Read a text file of a run folder.

    Raises:
        UserError: the file is missing, can't be read or is not UTF-8.
    """
    try:
        return path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise UserError(f"{path} is missing; {RERUN}") from error
    except (OSError, UnicodeDecodeError) as error:
        raise UserError(f"{path} can't be read: {error}; {RERUN}") from error
