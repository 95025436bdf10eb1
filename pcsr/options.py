"""Groups of a part's options: mappings in a recipe, immutable models in Python."""

from typing import Any

from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler, field_validator, model_validator
from pydantic_core import CoreSchema


class Options(BaseModel):
    """Base class of a group of options. Subclasses define a typed field with a default for each option.

    A part takes a group as a parameter of its constructor, such as `noise: Noise = Noise()`. Instances are
    immutable: a list in a recipe becomes a tuple.

    Examples:
        >>> class Noise(pcsr.Options):
        ...     blur: float = 0.0
        >>> Noise(blur=0.1).blur
        0.1
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False, protected_namespaces=())

    @field_validator("*", mode="before")
    @classmethod
    def _tuple(cls, value: Any) -> Any:
        return tuple(value) if isinstance(value, list) else value


class Choice(Options):
    """Base class of a choice between variants, named by `use`, with options. A bare name stands for `{use: name}`.

    Examples:
        >>> class Policy(pcsr.Choice):
        ...     spacing: float = 20.0
        >>> Policy.model_validate("uniform").use
        'uniform'
    """

    use: str

    @model_validator(mode="before")
    @classmethod
    def _named(cls, value: Any) -> Any:
        return {"use": value} if isinstance(value, str) else value

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return a schema that accepts the bare name or the mapping."""
        mapping = handler.resolve_ref_schema(handler(core))
        return {"anyOf": [mapping["properties"]["use"], dict(mapping)]}
