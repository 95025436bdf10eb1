"""What the files of a data set say of themselves: `manifest.json`, and the card in the header of each shard.

Keys that this version doesn't know are left alone, so that a later one may say more. What changes a meaning raises
`FORMAT`.
"""

from typing import Annotated, Any, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, FailFast, Field, ValidationError, model_validator

from pcsr.contracts import SPLITS
from pcsr.mistakes import explained, shown

Model = TypeVar("Model", bound=BaseModel)
Count = Annotated[int, Field(ge=0)]
Share = Annotated[float, Field(ge=0, le=1)]
Sha256 = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


def _reasons(value: dict[str, Any]) -> dict[str, str]:
    """Texts by name; of ten thousand wrong ones the first is reported, which pydantic alone would not do."""
    for name, reason in value.items():
        if not isinstance(reason, str):
            raise ValueError(f"what it says of {shown(name)} should be a text, but is {shown(reason)}")
    return value


Reasons = Annotated[dict[str, Any], AfterValidator(_reasons)]
Names = Annotated[tuple[str, ...], FailFast()]


class Stated(BaseModel):
    """Of the right types and finite, or refused; it never changes."""

    model_config = ConfigDict(extra="ignore", frozen=True, strict=True, allow_inf_nan=False)


class Part(Stated):
    """The name of a part, and its options beside it."""

    model_config = ConfigDict(extra="allow")

    use: str


class Settings(Stated):
    """A recipe's section `data`, every default filled in; what it holds beyond these a recipe's own check judges."""

    model_config = ConfigDict(extra="allow")

    shapes: Part
    touch: Part
    touches: Count
    """Of each object."""
    points: Annotated[int, Field(ge=1)]
    rate: Annotated[int, Field(ge=1)]
    truth: str
    sampling: str
    view: dict[str, Any] = Field(default_factory=dict)
    seed: Count


class Shard(Stated):
    """One file of a split."""

    file: str
    objects: Count
    sha256: Sha256


class Coverage(Stated):
    """The share of an object that its first touches cover: its mean over the objects, and three quantiles."""

    touches: Annotated[int, Field(ge=1)]
    mean: Share
    p10: Share
    p50: Share
    p90: Share


class Summary(Stated):
    """One split: what its shards hold together."""

    objects: Count
    groups: Count
    sensors: Names
    coverage: Annotated[tuple[Coverage, ...], FailFast()]
    """For 1, 2, … touches."""
    rejected: Reasons
    """The objects that could not be used, and why."""
    faults: Count
    """Of the rejected, those that are not the objects' doing; they are tried again by the next build."""
    shards: Annotated[tuple[Shard, ...], FailFast()]

    def place(self, row: int) -> tuple[int, int]:
        """The shard that holds an object, and the object's row in it."""
        for number, shard in enumerate(self.shards):
            if row < shard.objects:
                return number, row
            row -= shard.objects
        raise IndexError(f"no object {row} beyond the last shard")


class Formatted(Stated):
    """What every version's manifest says first."""

    format: int


class Manifest(Formatted):
    """All of a folder."""

    made_by: str
    fingerprint: Sha256
    data: Settings
    empty: Reasons = Field(default_factory=dict)
    """Why a split has no objects."""
    splits: dict[str, Summary]
    """Those that are built to their end."""

    @model_validator(mode="after")
    def _agrees(self) -> "Manifest":
        for split, about in self.splits.items():
            if split not in SPLITS:
                raise ValueError(f"splits.{split[:80]} is none of {', '.join(SPLITS)}")
            for number, shard in enumerate(about.shards):
                wanted = shard_name(split, number)
                if shard.file != wanted:  # so that none is listed twice or lies elsewhere
                    raise ValueError(f"splits.{split}.shards.{number}.file is {shard.file[:80]!r}, not '{wanted}'")
            there = sum(shard.objects for shard in about.shards)
            if about.objects != there:
                raise ValueError(f"splits.{split}.objects is {about.objects}, but its shards hold {there}")
            if about.objects and len(about.coverage) != self.data.touches:
                raise ValueError(
                    f"splits.{split}.coverage is of {len(about.coverage)} touches, data.touches is {self.data.touches}"
                )
        return self


class Card(Stated):
    """What a shard says of the objects in it, in their order."""

    fingerprint: Sha256
    """Of the data that it belongs to."""
    names: Names
    groups: Names
    spheres: Annotated[tuple[tuple[float, float, float, Annotated[float, Field(gt=0)]], ...], FailFast()]
    """Centre and radius, in the object's own frame, of the sphere that became the unit sphere."""
    coverage: Annotated[tuple[Annotated[tuple[Share, ...], FailFast()], ...], FailFast()]
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
    """What the file of shard `number` of a split is called."""
    return f"{split}-{number:05d}.safetensors"


def parsed(model: type[Model], text: str | bytes) -> Model:
    """A model of JSON text.

    Raises:
        ValueError: it has mistakes. The message names the first, and how many more there are.
    """
    try:
        return model.model_validate_json(text)
    except ValidationError as error:
        first, *others = error.errors(include_url=False)
        path = ".".join(str(key) for key in first["loc"] if key != "[key]")
        wrong = "it must be given" if first["type"] == "missing" else explained([first])
        message = f"{path}: {wrong}" if path else wrong
        raise ValueError(f"{message} (and {len(others)} more)" if others else message) from error
