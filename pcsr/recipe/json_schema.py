"""The JSON schema of recipes, from the parts that are installed: editors complete and check with it."""

from typing import Any

from pcsr.plugins.registry import Registry
from pcsr.recipe.part_keys import NAMES, PARTS
from pcsr.recipe.schema import Recipe, options_model


def json_schema(registry: Registry) -> dict[str, Any]:
    """A schema for recipe files, which may leave to their parent whatever they like.

    Parts that can't be loaded are left out.
    """
    schema = Recipe.model_json_schema()
    definitions = schema["$defs"]
    del definitions["PartSpec"]
    for section in (schema, *definitions.values()):
        section["required"] = []
    for (section_name, key), kind in PARTS.items():
        definition = f"{kind}-part"
        if definition not in definitions:
            definitions[definition] = {"anyOf": _choices(registry, kind, definitions)}
        reference: dict[str, Any] = {"$ref": f"#/$defs/{definition}"}
        optional = (section_name, key) == ("model", "touch_encoder")
        properties = definitions[str(section_name).capitalize()]["properties"]
        properties[key] = {"anyOf": [reference, {"type": "null"}]} if optional else reference
    for (section_name, key), kind in NAMES.items():
        definitions[section_name.capitalize()]["properties"][key]["items"] = {"enum": registry.names(kind)}
    del schema["properties"]["code"]  # nobody writes it
    schema["properties"] |= {
        "weights": {
            "anyOf": [{"type": "string"}, {"$ref": "#/$defs/Weights"}, {"type": "null"}],
            "description": "evaluated instead of training: shipped weights by name, or a file relative to this one",
        },
        "extends": {"type": "string", "description": "a recipe to start from, relative to this file"},
        "recipes": {
            "type": "array",
            "description": "recipes to compare, each with the rest of this file laid over it",
        },
        "matrix": {
            "type": "object",
            "additionalProperties": {"type": "array"},
            "description": "dotted keys to values",
        },
    }
    return schema


def _choices(registry: Registry, kind: str, definitions: dict[str, Any]) -> list[dict[str, Any]]:
    """The bare names, then each part with its options; they too may be left to the parent.

    The schemas of groups of options go into `definitions`, under the name of kind, part and group.
    """
    forms: list[dict[str, Any]] = []
    for name in registry.names(kind):
        try:
            part = registry.get(kind, name)
            template = f"#/$defs/{kind}-{name}-{{model}}"
            options = options_model(part).model_json_schema(ref_template=template)
        except Exception:  # not offered; `pcsr plugins` says why
            continue
        definitions |= {f"{kind}-{name}-{group}": inner for group, inner in options.get("$defs", {}).items()}
        forms.append(
            {
                "type": "object",
                "description": (part.__doc__ or "").partition("\n")[0],
                "properties": {"use": {"const": name}, **options.get("properties", {})},
                "additionalProperties": False,
            }
        )
    names = [form["properties"]["use"]["const"] for form in forms]
    return [{"enum": names, "description": f"the name of a part: {kind}"}, *forms]
