"""Every mistake of a recipe is reported at once, at its line and column, with the fix."""

import pytest

from pcsr.metrics import METRICS
from pcsr.recipe import RecipeError, load


def lines(path, registry, overrides=()):
    """What is wrong with a recipe, without the folder in which it is."""
    with pytest.raises(RecipeError) as caught:
        load(path, registry, overrides)
    return str(caught.value).replace(f"{path.parent}/", "").splitlines()


def test_all_mistakes_at_once_each_in_its_place(write, registry):
    path = write("""
        name: Bad Name
        sed: 1
        data:
          touches: many
          touch: {use: digit, points: 6.5}
        model:
          encoder: {use: net, channels: 0, ordr: file}
          fusion: atention
          backbone:
            use: refine
            steps: [1]
        train: {epochs: -3, augment: [rotate, shear]}
        evaluate:
          metrics: [cd, chamfer]
    """)
    assert lines(path, registry) == [
        "recipe.yaml:1:7: name: it must be up to 200 of a-z, 0-9, ., _ and -, the first a letter or a digit, got 'Bad Name'",  # noqa: E501
        "recipe.yaml:2:1: a recipe takes no 'sed': did you mean 'seed'?",
        "recipe.yaml:4:12: data.touches: it must be a whole number, got 'many'",
        "recipe.yaml:5:31: touch 'digit'.points: it must be a whole number, got 6.5",
        "recipe.yaml:7:3: model.upsampler is missing: add it",
        "recipe.yaml:7:33: encoder 'net'.channels: it must be more than 0, got 0",
        "recipe.yaml:7:36: encoder 'net' takes no 'ordr': did you mean 'order'?",
        "recipe.yaml:8:11: there is no fusion 'atention': did you mean 'attention'?",
        "recipe.yaml:11:12: backbone 'refine'.steps: it must be a whole number, got [1]",
        "recipe.yaml:12:17: train.epochs: it must be 1 or more, got -3",
        "recipe.yaml:12:39: train.augment.1: it must be 'rotate', 'scale', 'jitter', 'redraw', 'even', 'crop', 'noise', 'uneven' or 'other-touches', got 'shear'",  # noqa: E501
        "recipe.yaml:14:17: evaluate.metrics.1: there is no metric 'chamfer': known: cd, emd, hd, hd-pugcn, p2f",
    ]


def test_mistakes_in_parent_child_matrix_and_options_are_reported_together(write, registry):
    write("name: parent\nseed: -1\n", "parent.yaml", model=True)
    path = write("""
        extends: parent.yaml
        train: {batch: none}
        matrix:
          data.points: [64, 8]
          model.fusoin: [blend, attention]
    """)
    assert lines(path, registry, ["train.epochs=0", "model.encoder.channels='8'", "nonsense"]) == [
        "--set model.encoder.channels='8': encoder 'net'.channels: it must be a whole number, got '8'",
        "--set nonsense: write --set dotted.key=value, for example --set train.epochs=5",
        "--set train.epochs=0: train.epochs: it must be 1 or more, got 0",
        "parent.yaml:2:7: seed: it must be 0 or more, got -1",
        "recipe.yaml:2:16: train.batch: it must be a whole number, got 'none'",
        "recipe.yaml:4:21: data.points: it must be 16 or more, got 8",
        "recipe.yaml:5:3: model takes no 'fusoin': did you mean 'fusion'?",
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("data: {registration: {x: 1}}", "5:23: data registration takes no 'x': known: position, rotation"),
        ("data: {registration: {postion: 1}}", "5:23: data registration takes no 'postion': did you mean 'position'?"),
        ("data: {registration: {rotation: .nan}}", "5:33: data.registration.rotation: it must be a finite number"),
        ("data: {registration: {position: 101}}", "5:33: data.registration.position: it must be at most 100, got 101"),
        ("data: {registration: 5}", "5:22: data.registration is a section: write its keys under it, got 5"),
        ("patches: {pionts: 64}", "5:11: patches takes no 'pionts': did you mean 'points'?"),
    ],
)
def test_mistakes_in_optional_sections(write, registry, text, expected):
    [said] = lines(write(f"name: a\n\n\n\n{text}\n", model=True), registry)
    assert said.startswith(f"recipe.yaml:{expected}")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("name: a\nmodel: {fusion: null, encoder: 3, backbone: {steps: 1}, upsampler: dense}", [
            "recipe.yaml:2:17: model.fusion: name the part, as `fusion: attention` or with `use:`",
            "recipe.yaml:2:32: model.encoder: name the part, as `encoder: net` or with `use:`",
            "recipe.yaml:2:45: model.backbone: name the part, as `backbone: refine` or with `use:`",
        ]),
        ("name: a\nmodel: {encoder: net, fusion: {use: attention}, backbone: refine, upsampler: dense}", [
            "recipe.yaml:2:31: fusion 'attention'.heads is missing: add it",
        ]),
        ("name: a\nmodel: net\ndata: 5", [
            "recipe.yaml:2:8: model is a section: write its keys under it, got 'net'",
            "recipe.yaml:3:7: data is a section: write its keys under it, got 5",
        ]),
        ("seed: 1\nmodel: {encoder: net, fusion: blend, backbone: refine, upsampler: dense}", [
            "recipe.yaml:1:1: name is missing: add it",
        ]),
    ],
    ids=["parts without a name", "option without default", "sections that are none", "no name"],
)  # fmt: skip
def test_what_is_missing(write, registry, text, expected):
    assert lines(write(text), registry) == expected


def test_a_part_that_cannot_be_loaded_is_a_mistake_at_its_use(write, registry):
    path = write("name: a\nmodel: {encoder: net, fusion: broken, backbone: refine, upsampler: dense}")
    assert lines(path, registry) == [
        "recipe.yaml:2:31: fusion 'broken' of tests cannot be loaded from 'pcsr_no_such_module:Broken': "
        "ModuleNotFoundError: No module named 'pcsr_no_such_module'"
    ]


@pytest.mark.parametrize(
    ("touches", "said"),
    [
        ("[5, 2]", "18: train.touches: the minimum, 5, is more than the maximum, 2: swap them"),
        (
            "[0, 1, 2]",
            "18: train.touches: it must be a whole number or a list of at most 2 items",
        ),
        ("[0, 17]", "22: train.touches.1: it must be at most 16, got 17"),
    ],
)
def test_touches_in_training(write, registry, touches, said):
    (line,) = lines(write(f"name: a\ntrain: {{touches: {touches}}}", model=True), registry)
    assert line.startswith(f"recipe.yaml:2:{said}"), line


def test_a_touch_encoder_that_nobody_hears(write, registry):
    path = write("""
        name: a
        model: {encoder: net, touch_encoder: net, fusion: deaf, backbone: refine, upsampler: dense}
    """)
    assert lines(path, registry) == [
        "recipe.yaml:2:38: fusion 'deaf' uses no touch features, so a touch_encoder has no effect: remove it"
    ]


@pytest.mark.parametrize("value", [".inf", ".nan", "'1e-3'", "true"])
def test_a_rate_is_a_finite_number(write, registry, value):
    (line,) = lines(write(f"name: a\ntrain: {{learning_rate: {value}}}", model=True), registry)
    assert line.startswith("recipe.yaml:2:24: train.learning_rate: it must be a ")


def test_the_metrics_that_a_recipe_may_name_are_those_there_are(write, registry):
    names = ", ".join(METRICS)
    (recipe,) = load(write(f"name: a\nevaluate: {{metrics: [{names}]}}", model=True), registry)
    assert recipe.evaluate.metrics == tuple(METRICS)
    (line,) = lines(write("name: a\nevaluate: {metrics: [other]}", model=True), registry)
    assert "recipe.yaml:2:22: evaluate.metrics.0: there is no metric 'other'" in line
    assert all(name in line for name in METRICS)


def test_a_name_that_stands_in_a_list_twice(write, registry):
    text = "name: a\ntrain: {augment: [scale, jitter, scale]}\nevaluate: {metrics: [cd, cd], baselines: []}"
    assert lines(write(text, model=True), registry) == [
        "recipe.yaml:2:34: train.augment: 'scale' is listed twice: remove one of the two",
        "recipe.yaml:3:26: evaluate.metrics: 'cd' is listed twice: remove one of the two",
    ]


@pytest.mark.parametrize("name", ["truth", "input", "touches", "floor", "midpoint"])
def test_a_name_that_results_have_for_something_else(write, registry, name):
    (line,) = lines(write(f"name: {name}", model=True), registry)
    assert line == f"recipe.yaml:1:7: name: '{name}' is the name of another cloud or row of the results: take another"


def test_a_seed_that_generators_do_not_take(write, registry):
    assert load(write(f"name: a\nseed: {2**32 - 1}", model=True), registry)[0].seed == 2**32 - 1
    assert lines(write(f"name: a\nseed: {2**32}", model=True), registry) == [
        "recipe.yaml:2:7: seed: it must be less than 4294967296, got 4294967296"
    ]


def test_a_key_written_twice_is_reported_with_all_other_mistakes(write, registry):
    path = write("name: a\nname: b\ndata: {touches: 99}\nsed: 1", model=True)
    assert lines(path, registry) == [
        "recipe.yaml:2:1: 'name' is written twice: remove one of the two",
        "recipe.yaml:3:17: data.touches: it must be at most 16, got 99",
        "recipe.yaml:4:1: a recipe takes no 'sed': did you mean 'seed'?",
    ]


def test_what_could_not_be_read_is_one_mistake_beside_the_others(write, registry):
    path = write("name: a\nseed: !env SEED\ndata: {touches: 99}", model=True)
    assert lines(path, registry) == [
        "recipe.yaml:2:7: recipes are plain data: remove the tag !env",
        "recipe.yaml:3:17: data.touches: it must be at most 16, got 99",
    ]


@pytest.mark.parametrize(
    ("patches", "said"),
    [
        (
            "{rate: 3}",
            "17: patches.rate is 3, and no power of it is data.rate, 16: "
            "repeated passes of the network cannot reach that rate",
        ),
        (
            "{points: 4096}",
            "19: patches.points: a patch of 4096 points covers 16384 points of the truth, which has only 8192: "
            "lower it",
        ),
    ],
)
def test_patches_that_the_data_has_not(write, registry, patches, said):
    path = write(f"name: a\npatches: {patches}", model=True)
    (line,) = lines(path, registry)
    assert line == f"recipe.yaml:2:{said}"


@pytest.mark.parametrize("key", ["extends", "recipes"])
def test_what_is_read_before_is_said_to_be(write, registry, key):
    write("name: one\nmodel: {encoder: net, fusion: blend, backbone: refine, upsampler: dense}", "one.yaml")
    said = lines(write(f"name: study\nrecipes: [{{use: one.yaml, {key}: x}}]"), registry)
    assert any(f"'{key}' is a key of the file: write it at the top level" in line for line in said)
