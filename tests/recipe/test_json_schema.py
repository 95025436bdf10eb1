"""The schema that editors complete with: the sections, and the options of the parts that are installed."""

import json

from pcsr.plugins.loading import load_plugins
from pcsr.recipe.json_schema import json_schema
from pcsr.recipe.part_keys import PARTS


def choices(schema, kind):
    """The mapping forms of a kind of part, by name."""
    names, *forms = schema["$defs"][f"{kind}-part"]["anyOf"]
    assert names["enum"] == [form["properties"]["use"]["const"] for form in forms]
    return {form["properties"]["use"]["const"]: form for form in forms}


def test_each_part_is_offered_with_its_options(registry):
    schema = json_schema(registry)
    net = choices(schema, "encoder")["net"]
    assert list(net["properties"]) == ["use", "channels", "order", "layers", "dropout"]
    assert net["properties"]["channels"]["exclusiveMinimum"] == 0
    assert net["properties"]["order"]["enum"] == ["hilbert", "file"]
    assert net["additionalProperties"] is False
    assert "required" not in net  # `{channels: 4}` alone may be laid over a parent's encoder
    assert "heads" in choices(schema, "fusion")["attention"]["properties"]


def test_a_part_that_cannot_be_loaded_is_not_offered(registry):
    assert list(choices(json_schema(registry), "fusion")) == ["attention", "blend", "deaf"]


def test_every_place_of_a_part_is_described(registry):
    schema = json_schema(registry)
    for (*_, section, key), kind in PARTS.items():
        assert schema["$defs"][section.capitalize()]["properties"][key] == {"$ref": f"#/$defs/{kind}-part"} or (
            key == "touch_encoder"
        )
    for section in ("Model", "Graft"):
        assert {"type": "null"} in schema["$defs"][section]["properties"]["touch_encoder"]["anyOf"]


def test_sections_and_composition(registry):
    schema = json.loads(json.dumps(json_schema(registry)))
    assert set(schema["properties"]) == {
        "name",
        "seed",
        "data",
        "model",
        "patches",
        "train",
        "weights",
        "joined",
        "evaluate",
        "extends",
        "matrix",
        "recipes",
    }
    assert schema["required"] == []  # a recipe that extends another may leave out everything
    assert "touches" in schema["$defs"]["Data"]["properties"]
    referenced = {part.partition('"')[0] for part in json.dumps(schema).split("#/$defs/")[1:]}
    assert referenced == schema["$defs"].keys()


def test_groups_of_options_are_offered_by_name_and_key_by_key():
    schema = json_schema(load_plugins())
    digit = choices(schema, "touch")["digit"]["properties"]
    assert digit["noise"]["$ref"] == "#/$defs/touch-digit-Noise"
    assert schema["$defs"]["touch-digit-Noise"]["properties"]["blur"]["minimum"] == 0
    name, mapping = schema["$defs"]["touch-digit-SensorOptions"]["anyOf"]
    assert "gelsight-mini" in name["enum"]
    assert mapping["properties"]["width"]["default"] is None
