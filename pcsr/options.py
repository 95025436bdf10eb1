"""Groups of options inside of a part's options: mappings in a recipe, frozen records in Python."""

from typing import Any

from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler, field_validator, model_validator
from pydantic_core import CoreSchema


class Options(BaseModel):
    """A mapping of options. Derive from it, with a typed and defaulted field for each option.

    A part takes it as a parameter of its constructor, `noise: Noise = Noise()` for example. Instances are immutable: a
    list in a recipe is a tuple here.

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
    """One of several variants, named by `use`, and its options. A bare name is short for `{use: name}`.

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
        """A schema for the bare name and the mapping."""
        mapping = handler.resolve_ref_schema(handler(core))
        return {"anyOf": [mapping["properties"]["use"], dict(mapping)]}
