"""Groups of options inside of a part's options: mappings in a recipe, frozen records in Python."""

from typing import Any

from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler, field_validator, model_validator
from pydantic_core import CoreSchema


class Options(BaseModel):
    """A mapping of options. Derive from it, with a typed and defaulted field for each option.

    A part takes it as a parameter of its constructor, `noise: Noise = Noise()` for example. Values do not change: a
    list in a recipe is a tuple here.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False, protected_namespaces=())

    @field_validator("*", mode="before")
    @classmethod
    def _tuple(cls, value: Any) -> Any:
        return tuple(value) if isinstance(value, list) else value


class Choice(Options):
    """One of several variants, named by `use`, and its options. A bare name is short for `{use: name}`."""

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
