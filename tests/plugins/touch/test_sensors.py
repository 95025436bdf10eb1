import math
import tomllib
from dataclasses import replace
from importlib import resources
from pathlib import Path

import pytest

from pcsr import UserError
from pcsr.recipe.schema import options_model
from pcsr_plugins.touch.digit import Digit, sensors

PRESETS = ["digit", "digit-tacto", "gelsight-mini", "smith-2020", "smith-2021"]


def test_the_table_ships_with_the_package_and_a_recipe_offers_all_of_it():
    text = resources.files("pcsr_plugins.touch.digit").joinpath("sensors.toml").read_text(encoding="utf-8")
    assert list(tomllib.loads(text)) == sensors.names() == PRESETS
    sensor = options_model(Digit).model_json_schema()["$defs"]["SensorOptions"]
    assert sensor["anyOf"][0]["enum"] == PRESETS


@pytest.mark.parametrize("name", PRESETS)
def test_every_figure_has_a_source_and_a_doubt_and_is_an_option(name):
    options = sensors.SensorOptions.model_fields
    for figure in sensors.figures(name):
        assert figure.source
        assert isinstance(figure.doubt, str)
        assert figure.name in options
        assert getattr(sensors.load(name), figure.name) == figure.value


@pytest.mark.parametrize("name", PRESETS)
def test_the_docs_say_every_figure_as_it_is(name):
    page = (Path(__file__).parents[3] / "docs" / "touch-sensors.md").read_text(encoding="utf-8")
    section = page.split(f"### `{name}`\n")[1].split("\n#")[0]
    rows = [line for line in section.splitlines() if line.startswith("| `")]
    shown = [
        f"| `{figure.name}` | {shown_value(figure.value)} | {figure.source} | {figure.doubt} |"
        for figure in sensors.figures(name)
    ]
    assert rows[: len(shown)] == shown


def shown_value(value):
    if isinstance(value, tuple):
        return " × ".join(f"{part:g}" for part in value)
    return value if isinstance(value, str) else f"{value:g}"


@pytest.mark.parametrize("name", PRESETS)
def test_pixels_are_square_and_within_the_housing(name):
    sensor = sensors.load(name)
    columns, rows = sensor.pixels
    assert sensor.height / rows == pytest.approx(sensor.width / columns, rel=0.01)
    assert sensor.pitch == pytest.approx(sensor.width / columns)
    assert sensor.width <= sensor.housing[0]
    assert sensor.height <= sensor.housing[1]
    assert (sensor.fov is None) == (sensor.distance is None) == (sensor.projection == "orthographic")
    assert (sensor.reach is None) == (sensor.senses == "pressure")


def test_what_a_camera_sees_of_the_face_follows_from_its_figures():
    smith = sensors.load("smith-2021")
    assert smith.width == smith.height == pytest.approx(9.317, abs=1e-3)
    assert smith.distance + smith.reach == pytest.approx(25)
    tacto = sensors.load("digit-tacto")
    assert (tacto.width, tacto.height) == pytest.approx((19.05, 25.40), abs=0.01)
    wide = sensors.load("smith-2021", fov=90.0, distance=10.0, pixels=50)
    assert (wide.width, wide.height, wide.pixels) == (pytest.approx(20), pytest.approx(20), (50, 50))


def test_a_changed_figure_changes_nothing_else():
    preset = sensors.load("gelsight-mini")
    assert sensors.load("gelsight-mini", width=None, dome=None) == preset
    wide = sensors.load("gelsight-mini", housing=(40.0, 30.0))
    assert wide == replace(preset, housing=(40.0, 30.0), name="gelsight-mini (changed)")
    few = sensors.load("gelsight-mini", width=20.0, pixels=200)
    assert (few.width, few.height, few.pixels) == (20.0, preset.height, (200, 152))
    assert sensors.load("digit-tacto", dome="flat").dome is None
    assert sensors.load("digit", dome=(50.0, 23.0)).dome == (50.0, 23.0)


def test_the_projection_can_be_changed_with_what_it_needs():
    tacto = sensors.load("digit-tacto")
    flat = sensors.load("digit-tacto", projection="orthographic")
    assert (flat.width, flat.height, flat.pixels) == (tacto.width, tacto.height, tacto.pixels)
    assert flat.fov is flat.distance is None
    camera = sensors.load("digit", projection="perspective", fov=60.0, distance=22.0)
    assert camera.height == pytest.approx(44 * math.tan(math.radians(30)))
    assert camera.width == pytest.approx(camera.height * 121 / 91)
    near = sensors.load("digit", senses="proximity", reach=5.0)
    assert (near.senses, near.reach) == ("proximity", 5.0)
    assert sensors.load("smith-2020", senses="pressure").reach is None


@pytest.mark.parametrize(
    ("name", "changes", "message"),
    [
        ("smith-2012", {}, "there is no sensor 'smith-2012': did you mean 'smith-2021'"),
        ("digit-tacto", {"width": 20.0}, "sensor 'digit-tacto': width is 20.0, but .* follows from its fov"),
        ("digit", {"fov": 60.0}, "sensor 'digit': fov is 60.0, but only a perspective sensor .* projection"),
        ("digit", {"projection": "perspective", "fov": 60.0}, "a perspective sensor needs its distance"),
        ("digit", {"reach": 2.0}, "reach is 2.0, but only a proximity sensor"),
        ("digit", {"senses": "proximity"}, "a proximity sensor needs its reach"),
        ("smith-2021", {"projection": "orthographic", "fov": 40.0}, "fov is 40.0, but only"),
    ],
)
def test_figures_that_contradict_each_other_are_said(name, changes, message):
    with pytest.raises(UserError, match=message):
        sensors.load(name, **changes)
