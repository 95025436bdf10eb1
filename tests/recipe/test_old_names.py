"""Names and options of pcsr 0.1 are read, and fingerprints stay those of 0.1."""

import hashlib
import json
from pathlib import Path

import pytest

from pcsr.data.plan import Plan
from pcsr.errors import PcsrWarning
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import RecipeError, for_data, load
from pcsr.recipe.old_names import REMOVED

RECIPES = Path(__file__).parents[2] / "pcsr/recipes"
WRITTEN = json.loads(Path(__file__).with_name("fingerprints.json").read_text())
"""By recipe file: hashes of the fingerprints of its runs and of their data, as 0.1 had them."""
REGISTRY = load_plugins()
OF_0_1 = """
name: old
data:
  shapes: {use: cad-parts, count: 2, held_out: 1}
  touch: {use: digit, sensor: digit-tacto, pixels: 96, dome: flat, policy: grasp, spacing: 18.0, blur: 0.2, tries: 50}
  points: 64
model:
  encoder: {use: frames, channels: 16}
  fusion: {use: anchored, heard: 12}
  touch_encoder: {use: frames, channels: 8}
  backbone: frames
  upsampler: fan
patches: {points: 32, rate: 4, cover: 2.0}
train: {objective: surface, rate: 2e-3, epochs: 3}
evaluate: {beside: [midpoint]}
matrix:
  train.rate: [1e-3, 2e-3]
  data.touch.depth_noise: [0.0, 0.1]
"""
FINGERPRINTS = [
    ("d05e945d90b4529e1fc214fe48d96412ce9987c58e8228d3a998bd14f681396b", "7654aaf7"),
    ("490eff9d5ae1ba7d7f202a33d20e54f8f81e9c90dba15629a49c4173e4cfde64", "ff11b159"),
    ("a7733f0104a5392c669cb3c1352ddcbcdbd7ca40872763a34b3d4f4e9869bbf9", "7654aaf7"),
    ("03513bd403ec74c7619bb96e7d77c8de2e17929925e8e7f05fe3b720c5ce2b19", "ff11b159"),
]
"""What 0.1 gave for the runs of `OF_0_1` and for their data."""


@pytest.mark.filterwarnings("ignore::pcsr.PcsrWarning")
def test_a_recipe_of_0_1_has_the_fingerprints_that_it_had(tmp_path):
    (tmp_path / "old.yaml").write_text(OF_0_1)
    runs = load(tmp_path / "old.yaml", REGISTRY)
    assert [(run.fingerprint, Plan.of(run, REGISTRY).fingerprint[:8]) for run in runs] == FINGERPRINTS
    touch = runs[1].resolved()["data"]["touch"]
    assert touch["sensor"] == {"use": "digit-tacto", "pixels": 96, "dome": "flat"} | dict.fromkeys(
        ("projection", "width", "height", "fov", "distance", "housing", "protrusion", "senses", "reach")
    )
    assert touch["policy"] == {"use": "grasp", "spacing": 18.0, "tries": 50}
    assert (touch["noise"]["blur"], touch["noise"]["depth_noise"]) == (0.2, 0.1)


def test_one_warning_names_all_old_names(tmp_path):
    (tmp_path / "old.yaml").write_text(OF_0_1[: OF_0_1.index("matrix")])
    with pytest.warns(PcsrWarning, match="names of pcsr 0.1") as warned:
        load(tmp_path / "old.yaml", REGISTRY)
    (text,) = {str(one.message) for one in warned}
    for said in (
        "of touch 'digit' pixels, dome stand under 'sensor' now",
        "of touch 'digit' spacing, tries stand under 'policy' now",
        "of touch 'digit' blur stand under 'noise' now",
        "fusion 'anchored' is now 'edge-conv'",
        "option 'heard' of fusion 'edge-conv' is now 'points_per_touch'",
        "train.rate is now train.learning_rate",
    ):
        assert said in text


@pytest.mark.filterwarnings("ignore::pcsr.PcsrWarning")
def test_an_old_option_with_a_wrong_value_is_marked_where_it_stands(tmp_path):
    (tmp_path / "old.yaml").write_text("name: x\ndata:\n  touch: {use: digit,\n    tries: 0}\n")
    with pytest.raises(RecipeError) as mistakes:
        load(tmp_path / "old.yaml", REGISTRY)
    assert (
        str(mistakes.value) == f"{tmp_path / 'old.yaml'}:4:12: touch 'digit'.policy.tries: it must be 1 or more, got 0"
    )


@pytest.mark.parametrize("name", sorted(path.relative_to(RECIPES).as_posix() for path in RECIPES.rglob("*.yaml")))
def test_the_fingerprints_of_recipes_and_data_have_not_changed(name):
    runs = [run.model_copy(update={"weights": None}) for run in load(RECIPES / name, REGISTRY)]
    data = [Plan.of(run, REGISTRY).fingerprint for run in runs]
    assert [digest([run.fingerprint for run in runs]), digest(data)] == WRITTEN[name]


def digest(fingerprints):
    return hashlib.sha256(json.dumps(fingerprints).encode()).hexdigest()[:16]


@pytest.mark.parametrize(
    ("options", "sensor"),
    [
        (["touch.sensor=gelsight-mini"], ("gelsight-mini", None)),
        (["touch.sensor.width=20"], ("digit", 20.0)),
        (["touch.sensor=gelsight-mini", "touch.sensor.width=20"], ("gelsight-mini", 20.0)),
        (["touch.sensor.width=20", "touch.sensor=gelsight-mini"], ("gelsight-mini", None)),
        (["touch.sensor={use: digit, width: 20}", "touch.sensor=digit"], ("digit", 20.0)),
        (["touch.sensor={use: digit, width: 20}", "touch.sensor={use: gelsight-mini}"], ("gelsight-mini", None)),
    ],
)
def test_the_options_of_a_choice_stay_with_its_name_and_go_with_it(options, sensor):
    chosen = for_data("cad-parts", {}, REGISTRY, options).data.touch.options["sensor"]
    assert (chosen.use, chosen.width) == sensor


@pytest.mark.filterwarnings("ignore::pcsr.PcsrWarning")
def test_an_old_option_of_a_part_that_is_not_named_is_read():
    chosen = for_data("cad-parts", {}, REGISTRY, ["touch.blur=0.2", "touch.sensor=digit-tacto", "touch.tries=9"])
    noise, policy = (chosen.data.touch.options[group] for group in ("noise", "policy"))
    assert (noise.blur, policy.tries, chosen.data.touch.options["sensor"].use) == (0.2, 9, "digit-tacto")


@pytest.mark.parametrize(
    ("touch", "said"),
    [
        (
            "{use: digit, sensor: digti}",
            "3:31: touch 'digit'.sensor: there is no sensor 'digti': did you mean 'digit'?",
        ),
        ("{use: digit, sensor: {widht: 3}}", "3:32: touch 'digit' sensor takes no 'widht': did you mean 'width'?"),
        ("{use: digit, noise: {blur: -1}}", "3:37: touch 'digit'.noise.blur: it must be 0 or more, got -1"),
        ("{use: digit, noise: 3}", "3:30: touch 'digit'.noise is a section: write its keys under it, got 3"),
    ],
)
def test_a_mistake_inside_of_a_group_has_its_place(tmp_path, touch, said):
    path = tmp_path / "wrong.yaml"
    path.write_text(f"name: x\ndata:\n  touch: {touch}\n")
    with pytest.raises(RecipeError) as mistakes:
        load(path, REGISTRY)
    assert str(mistakes.value) == f"{path}:{said}"


@pytest.mark.parametrize(
    ("section", "key", "part", "other"),
    [
        ("model", "upsampler", "branches", "chained: true"),
        ("model", "upsampler", "progressive", "step: 4"),
        ("train", "objective", "pu-gan", "fidelity: chamfer"),
        ("train", "objective", "pu-net", "fidelity: chamfer"),
    ],
)
def test_an_option_that_is_gone_may_be_written_with_its_default(section, key, part, other, tmp_path):
    ((option, default),) = REMOVED[key, part].items()
    path = tmp_path / "old.yaml"
    written = json.dumps({"use": part, option: default})
    path.write_text(f"extends: {RECIPES / 'pu-net.yaml'}\n{section}: {{{key}: {written}}}\n")
    (old,) = load(path, REGISTRY)
    path.write_text(f"extends: {RECIPES / 'pu-net.yaml'}\n{section}: {{{key}: {part}}}\n")
    (new,) = load(path, REGISTRY)
    assert old.fingerprint == new.fingerprint
    path.write_text(f"extends: {RECIPES / 'pu-net.yaml'}\n{section}: {{{key}: {{use: {part}, {other}}}}}\n")
    with pytest.raises(RecipeError, match=f"'{part}' takes no '{option}'"):
        load(path, REGISTRY)
