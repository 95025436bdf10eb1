"""What the sections of a recipe consist of: their base class, and the specification of a part."""

from typing import Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from pcsr.plugins.guard import guarded
from pcsr.plugins.part_choice import PartChoice
from pcsr.plugins.registry import Registry

AS_TUPLE = BeforeValidator(lambda value: tuple(value) if isinstance(value, list) else value)
"""Validator that turns the lists of YAML into tuples, which cannot change."""
FEW = Field(max_length=16)
"""Limit of the lists of names."""


class Section(BaseModel):
    """Section of a recipe. Unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)


class PartSpec(Section):
    """Name of a part with its options. A checked recipe holds all options, with their defaults."""

    use: str
    options: dict[str, Any] = Field(default_factory=dict)

    def build(self, registry: Registry, kind: str, *host: Any) -> Any:
        """Build the part. `host` are the arguments that the host passes by position, such as `Widths`."""
        part = registry.get(kind, self.use)
        options = {
            name: value.with_registry(registry) if isinstance(value, PartChoice) else value
            for name, value in self.options.items()
        }
        with guarded(f"the constructor of {kind} '{self.use}'"):
            return part(*host, **options)

    def needs(self, registry: Registry, kind: str) -> dict[str, str]:
        """Return the optional packages that the part needs, each with the part's name, for `pcsr.extras.require`.

        Those of parts that its options name are among them.
        """
        inner = [(one.kind, one.use) for one in self.options.values() if isinstance(one, PartChoice)]
        return {
            package: f"{of} '{name}'"
            for of, name in [*inner, (kind, self.use)]
            for package in sorted(registry.get(of, name).needs)
        }
