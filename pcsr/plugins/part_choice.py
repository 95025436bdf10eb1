"""Option of a part that names a part of another kind, such as the policy of a touch source."""

import json
from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, GetJsonSchemaHandler, PrivateAttr
from pydantic_core import CoreSchema

from pcsr.options import Choice
from pcsr.plugins.guard import guarded
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Registry


class PartChoice(Choice):
    """Base class of a choice of a part, named by `use`, with the part's options beside those of the class itself.

    Subclasses set `kind`. A bare name stands for `{use: name}`.

    Examples:
        >>> class PolicyOptions(pcsr.PartChoice):
        ...     kind = "policy"
        ...     use: str = "uniform"
        ...     tries: int = 100
        >>> PolicyOptions.model_validate({"use": "mine", "weight": 2}).part_options
        {'weight': 2}
        >>> type(PolicyOptions.model_validate("sparse").part()).__name__
        'Sparse'
    """

    model_config = ConfigDict(extra="allow")
    kind: ClassVar[str]
    """Kind of the part."""
    _registry: Registry | None = PrivateAttr(default=None)

    @property
    def part_options(self) -> dict[str, Any]:
        """Options of the part: those that the class itself does not have."""
        return dict(self.model_extra or {})

    def part(self) -> Any:
        """Build the part, from the registry that `with_registry` set or else from the installed plugins.

        Raises:
            UserError: there is no such part.
            TypeError: the part has no such option.
        """
        part = (self._registry or load_plugins()).get(self.kind, self.use)
        with guarded(f"the constructor of {self.kind} '{self.use}'"):
            return part(**self.part_options)

    def with_registry(self, registry: Registry) -> "PartChoice":
        """Return a copy that builds its part from a registry."""
        copy = self.model_copy()
        copy._registry = registry
        return copy

    def completed(self, model: type[BaseModel]) -> "PartChoice":
        """Return a copy with all options of the part, checked by their model.

        Raises:
            ValidationError: an option of the part is unknown or has an invalid value.
        """
        checked = model.model_validate_json(json.dumps(self.part_options))
        options = {name: getattr(checked, name) for name in type(checked).model_fields}
        return type(self).model_construct(**{name: getattr(self, name) for name in type(self).model_fields}, **options)

    @classmethod
    def __get_pydantic_json_schema__(cls, core: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Return a schema that accepts the bare name or the mapping, with the names of the installed parts."""
        schema = super().__get_pydantic_json_schema__(core, handler)
        names = {"enum": load_plugins().names(cls.kind)}
        bare, mapping = schema["anyOf"]
        mapping = {**mapping, "properties": {**mapping["properties"], "use": {**mapping["properties"]["use"], **names}}}
        return {"anyOf": [{**bare, **names}, mapping]}
