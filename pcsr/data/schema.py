"""Models of a data set's metadata: `manifest.json`, and the card in the header of each shard.

Unknown keys are ignored, so that later versions may add some. A change of meaning increases `FORMAT`.
"""

from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, FailFast, Field, ValidationError, model_validator

from pcsr.contracts import SPLITS
from pcsr.validation_messages import explained, shown

Model = TypeVar("Model", bound=BaseModel)
Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


def _reasons(value: dict[str, Any]) -> dict[str, str]:
    """Check that all reasons are text, and report the first that is not; pydantic would report each of them."""
    for name, reason in value.items():
        if not isinstance(reason, str):
            raise ValueError(f"the reason for {shown(name)} must be text, got {shown(reason)}")
    return value


Reasons = Annotated[dict[str, Any], AfterValidator(_reasons)]
Names = Annotated[tuple[str, ...], FailFast()]


class FrozenModel(BaseModel):
    """Immutable model with strict types and finite numbers."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True, allow_inf_nan=False)


class Part(FrozenModel):
    """Name of a part, with its options as further keys."""

    model_config = ConfigDict(extra="allow")

    use: str


class Settings(FrozenModel):
    """Section `data` of the recipe with all defaults. Further keys are not checked here, but with the recipe."""

    model_config = ConfigDict(extra="allow")

    shapes: Part
    touch: Part
    touches: Count
    """Number of touches for each object."""
    points: Annotated[int, Field(ge=1)]
    rate: Annotated[int, Field(ge=1)]
    truth: str
    sampling: str
    view: dict[str, Any] = Field(default_factory=dict)
    seed: Count

    @property
    def registered(self) -> bool:
        """Whether the touches are registered, so that an object may have fewer than `touches`."""
        return bool((self.model_extra or {}).get("registration"))


class Shard(FrozenModel):
    """File of a split."""

    file: str
    objects: Count
    sha256: Sha256


class Coverage(FrozenModel):
    """Share of the truth's points that the first `touches` touches cover: mean and percentiles over the objects."""

    touches: Annotated[int, Field(ge=1)]
    mean: Share
    p10: Share
    p50: Share
    p90: Share


class Summary(FrozenModel):
    """Summary of a split over all its shards."""

    objects: Count
    groups: Count
    sensors: Names
    coverage: Annotated[tuple[Coverage, ...], FailFast()]
    """Coverage by 1, 2, … touches."""
    rejected: Reasons
    """Objects that could not be used, with the reasons."""
    faults: Count
    """Number of objects that were rejected because of an unexpected error, and that the next build tries again."""
    shards: Annotated[tuple[Shard, ...], FailFast()]

    def locate(self, row: int) -> tuple[int, int]:
        """Return the index of the shard that holds an object, and the object's row in it."""
        for number, shard in enumerate(self.shards):
            if row < shard.objects:
                return number, row
            row -= shard.objects
        raise IndexError(f"no object {row} beyond the last shard")


class FormatVersion(FrozenModel):
    """Part of the manifest that is the same in all versions of the format."""

    format: int


class Manifest(FormatVersion):
    """Content of `manifest.json`, which describes a data set."""

    made_by: str
    """Version of pcsr that built the data set."""
    fingerprint: Sha256
    data: Settings
    empty: Reasons = Field(default_factory=dict)
    """Splits without objects, with the reasons."""
    splits: dict[str, Summary]
    """Finished splits."""

    @model_validator(mode="after")
    def _agrees(self) -> "Manifest":
        for split, about in self.splits.items():
            if split not in SPLITS:
                raise ValueError(f"splits.{split[:80]} is none of {', '.join(SPLITS)}")
            for number, shard in enumerate(about.shards):
                wanted = shard_name(split, number)
                if shard.file != wanted:  # rules out duplicates and files of other folders
                    raise ValueError(f"splits.{split}.shards.{number}.file is {shard.file[:80]!r}, not '{wanted}'")
            there = sum(shard.objects for shard in about.shards)
            if about.objects != there:
                raise ValueError(f"splits.{split}.objects is {about.objects}, but its shards hold {there}")
            if about.objects and len(about.coverage) != self.data.touches:
                raise ValueError(
                    f"splits.{split}.coverage lists {len(about.coverage)} touches, but data.touches is "
                    f"{self.data.touches}"
                )
        return self


class Card(FrozenModel):
    """Metadata of a shard; lists are in the order of its objects."""

    fingerprint: Sha256
    """Fingerprint of the data set that the shard belongs to."""
    names: Names
    groups: Names
    spheres: Annotated[tuple[tuple[float, float, float, Annotated[float, Field(gt=0)]], ...], FailFast()]
    """Centre and radius of the truth's bounding sphere, in the object's own frame: x, y, z, radius."""
    coverage: Annotated[tuple[Annotated[tuple[Share, ...], FailFast()], ...], FailFast()]
    """Share of each object's truth that its first 1, 2, … touches cover."""
    sensors: Names
    rejected: Reasons
    faults: Count

    @model_validator(mode="after")
    def _agrees(self) -> "Card":
        for key in ("groups", "spheres", "coverage"):
            if len(getattr(self, key)) != len(self.names):
                raise ValueError(f"it has {len(self.names)} names and {len(getattr(self, key))} {key}")
        return self


def shard_name(split: str, number: int) -> str:
    """Return the file name of shard `number` of a split."""
    return f"{split}-{number:05d}.safetensors"


def parsed(model: type[Model], text: str | bytes) -> Model:
    """Parse JSON text into a model.

    Raises:
        ValueError: the text has mistakes. The message describes the first, and counts the others.
    """
    try:
        return model.model_validate_json(text)
    except ValidationError as error:
        first, *others = error.errors(include_url=False)
        path = ".".join(str(key) for key in first["loc"] if key != "[key]")
        mistake = "it is missing" if first["type"] == "missing" else explained([first])
        message = f"{path}: {mistake}" if path else mistake
        raise ValueError(f"{message} (and {len(others)} more)" if others else message) from error
