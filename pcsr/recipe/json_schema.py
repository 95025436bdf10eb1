"""JSON schema of recipes with the options of all installed parts, for completion and checks in editors."""

from typing import Any

from pcsr.plugins.registry import Registry
from pcsr.recipe.optimizers import OPTIMIZERS, optimizer_options
from pcsr.recipe.part_keys import NAMES, PART_LISTS, PARTS
from pcsr.recipe.schema import Recipe, options_model


def json_schema(registry: Registry) -> dict[str, Any]:
    """Return the JSON schema of recipe files.

    No key is required, since a recipe may inherit it from the one that it extends. Parts that cannot be loaded are
    omitted.
    """
    schema = Recipe.model_json_schema()
    definitions = schema["$defs"]
    del definitions["PartSpec"]
    for section in (schema, *definitions.values()):
        section["required"] = []
    for keys, kind in (PARTS | PART_LISTS).items():
        section_name, key = str(keys[-2]), str(keys[-1])
        definition = f"{kind}-part"
        if definition not in definitions:
            definitions[definition] = {"anyOf": _choices(registry, kind, definitions)}
        reference: dict[str, Any] = {"$ref": f"#/$defs/{definition}"}
        optional = key == "touch_encoder"
        properties = definitions[section_name.capitalize()]["properties"]
        if keys in PART_LISTS:
            properties[key]["items"] = reference
        else:
            properties[key] = {"anyOf": [reference, {"type": "null"}]} if optional else reference
    definitions["Train"]["properties"]["optimizer"] = {"anyOf": _optimizers()}
    for (section_name, key), kind in NAMES.items():
        definitions[section_name.capitalize()]["properties"][key]["items"] = {"enum": registry.names(kind)}
    model = schema["properties"]["model"]
    model["anyOf"] = model.pop("oneOf")  # a section that names no part yet may become either
    schema["$defs"]["Graft"]["properties"]["network"] = {"type": "string", "description": "FILE:CLASS"}
    del schema["properties"]["code"]  # never written by hand
    schema["properties"] |= {
        "weights": {
            "anyOf": [{"type": "string"}, {"$ref": "#/$defs/Weights"}, {"type": "null"}],
            "description": "weights to evaluate instead of training: a name, or a file relative to this one",
        },
        "extends": {"type": "string", "description": "recipe file to inherit from, relative to this file"},
        "recipes": {
            "type": "array",
            "description": "recipe files to compare; the other keys of this file override those of the listed files",
        },
        "matrix": {
            "type": "object",
            "additionalProperties": {"type": "array"},
            "description": "dotted keys with lists of values; each combination is one run",
        },
    }
    return schema


def _optimizers() -> list[dict[str, Any]]:
    """List the schemas of an optimizer: its bare name, then for each the mapping of its name and options."""
    return [
        {"enum": list(OPTIMIZERS), "description": "name of an optimizer of torch.optim"},
        *(
            _form(name, f"torch.optim.{kind.__name__}", optimizer_options(name).model_json_schema())
            for name, kind in OPTIMIZERS.items()
        ),
    ]


def _choices(registry: Registry, kind: str, definitions: dict[str, Any]) -> list[dict[str, Any]]:
    """List the schemas of a part: its bare name, then for each part the mapping of its name and options.

    The schemas of groups of options are added to `definitions`, under the name of kind, part and group.
    """
    forms: list[dict[str, Any]] = []
    for name in registry.names(kind):
        try:
            part = registry.get(kind, name)
            template = f"#/$defs/{kind}-{name}-{{model}}"
            options = options_model(part).model_json_schema(ref_template=template)
        except Exception:  # omitted; `pcsr plugins` reports the error
            continue
        definitions |= {f"{kind}-{name}-{group}": inner for group, inner in options.get("$defs", {}).items()}
        forms.append(_form(name, (part.__doc__ or "").partition("\n")[0], options))
    names = [form["properties"]["use"]["const"] for form in forms]
    return [{"enum": names, "description": f"name of a part of the kind {kind}"}, *forms]


def _form(name: str, description: str, options: dict[str, Any]) -> dict[str, Any]:
    """Return the schema of the mapping of a name and options."""
    return {
        "type": "object",
        "description": description,
        "properties": {"use": {"const": name}, **options.get("properties", {})},
        "additionalProperties": False,
    }
