"""The JSON schema of recipes, from the parts that are installed: editors complete and check with it."""

from typing import Any

from pcsr.recipe.compose import PARTS
from pcsr.recipe.schema import DEFAULTS, Recipe, options_model
from pcsr.registry import Registry


def json_schema(registry: Registry) -> dict[str, Any]:
    """A schema for recipe files; parts that can't be loaded are left out."""
    schema = Recipe.model_json_schema()
    definitions = schema["$defs"]
    definitions.pop("PartSpec", None)
    for keys in sorted(PARTS):
        kind = {"touch_encoder": "encoder"}.get(str(keys[1]), str(keys[1]))
        definitions.setdefault(f"{kind} part", {"anyOf": _choices(registry, kind)})
        section = definitions[str(keys[0]).capitalize()]
        section["properties"][keys[1]] = {"$ref": f"#/$defs/{kind} part"}
        section["required"] = [key for key in section["required"] if key not in DEFAULTS.get(str(keys[0]), {})]
    schema["properties"] |= {
        "extends": {"type": "string", "description": "a recipe to start from, relative to this file"},
        "matrix": {"type": "object", "additionalProperties": {"type": "array"}, "description": "dotted keys to values"},
    }
    schema["required"] = ["name"]
    return schema


def _choices(registry: Registry, kind: str) -> list[dict[str, Any]]:
    names: list[str] = []
    choices: list[dict[str, Any]] = []
    for name in registry.names(kind):
        try:
            part = registry.get(kind, name)
            options = options_model(part).model_json_schema()
        except Exception:  # noqa: S112 - a part that doesn't load is not offered; `pcsr plugins` says why
            continue
        names.append(name)
        properties = {"use": {"const": name}, **options.get("properties", {})}
        described = (part.__doc__ or "").partition("\n")[0]
        choices.append(
            {
                "type": "object",
                "description": described,
                "properties": properties,
                "required": ["use", *options.get("required", [])],
                "additionalProperties": False,
            }
        )
    return [{"enum": names, "description": f"the name of a {kind}"}, *choices]
