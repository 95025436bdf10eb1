"""A matrix, and studies over several recipes."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pcsr.recipe import RecipeError
from pcsr.recipe.compose import compose
from pcsr.recipe.matrix import expand
from pcsr.recipe.merge import normalize
from pcsr.recipe.schema import NAME
from pcsr.recipe.source import Location, parse
from tests.recipe.sources import source


def model(text):
    return normalize(parse(f"model: {{encoder: {text}}}", "file"))


def test_matrix_is_a_product_with_tidy_names(write):
    path = write("""
        name: grid
        train: {epochs: 1}
        matrix:
          model.fusion: [none, {use: Cross_Attention, heads: 2}]
          train.touches: [0, [0, 5]]
    """)
    runs = list(compose(path))
    assert [run.data["name"] for run in runs] == [
        "grid-fusion.none-touches.0",
        "grid-fusion.none-touches.0.5",
        "grid-fusion.cross_attention-touches.0",
        "grid-fusion.cross_attention-touches.0.5",
    ]
    assert runs[3].data["model"]["fusion"] == {"use": "Cross_Attention", "heads": 2}
    assert runs[3].data["train"] == {"epochs": 1, "touches": [0, 5]}
    assert runs[3].location(("train", "touches")) == Location(str(path), 5, 22)
    assert "matrix" not in runs[0].data


def test_names_have_values_as_they_are_where_a_folder_may_be_called_so(write):
    path = write("""
        name: grid
        matrix:
          model.fusion: [cross-attention, -x-]
          train.learning_rate: [0.001, 1e-5, -1]
    """)
    rates = ("learning_rate.0.001", "learning_rate.1e-05", "learning_rate.1")
    assert [run.data["name"] for run in compose(path)] == [
        f"grid-fusion.{fusion}-{rate}" for fusion in ("cross-attention", "x") for rate in rates
    ]


def test_keys_of_a_matrix_may_vary_together(write):
    path = write("""
        name: rows
        model: {encoder: net, touch_encoder: net, fusion: blend}
        matrix:
          row:
            - {model.fusion: none, model.touch_encoder: null}
            - {model.fusion: blend}
    """)
    without, whole = compose(path)
    assert (without.data["name"], whole.data["name"]) == ("rows-row.none", "rows-row.blend")
    assert without.data["model"] == {
        "encoder": {"use": "net"},
        "touch_encoder": None,
        "fusion": {"use": "none"},
    }
    assert whole.data["model"]["touch_encoder"] == {"use": "net"}
    assert without.location(("model", "fusion")) == Location(str(path), 5, 22)


def test_runs_of_a_matrix_are_numbered_where_their_labels_are_the_same(write):
    path = write("""
        name: widths
        matrix:
          model.encoder: [{use: net, channels: 4}, {use: net, channels: 8}, mlp]
          seed: [1, 2]
    """)
    assert [run.data["name"] for run in compose(path)] == [
        f"widths-encoder.{label}-seed.{seed}" for label in ("net.1", "net.2", "mlp.3") for seed in (1, 2)
    ]


@given(st.lists(st.integers(-9, 9) | st.text("aB-_. ", max_size=3), min_size=1, max_size=6))
def test_every_run_of_a_matrix_has_a_legal_name_of_its_own(values):
    recipe = source({"name": "a", "matrix": {"data.key": values}})
    names = [run.data["name"] for run in expand(recipe)]
    assert len(set(names)) == len(values)
    assert all(re.fullmatch(NAME, name) for name in names)


def test_set_wins_over_the_matrix(write):
    path = write("name: a\nmatrix: {seed: [1, 2], data.points: [64, 128]}")
    runs = list(compose(path, ["data.points=32"]))
    assert [run.data for run in runs] == [
        {"name": f"a-seed.{seed}", "seed": seed, "data": {"points": 32}} for seed in (1, 2)
    ]
    together = write("name: a\nmatrix: {row: [{data.points: 64, data.rate: 2}]}", "together.yaml")
    (run,) = compose(together, ["data.rate=4"])
    assert [mistake.text for mistake in run.mistakes] == [
        "the matrix varies data.rate together with others: change matrix.row in the file"
    ]


@pytest.mark.parametrize(
    ("matrix", "column"),
    [("[1]", 9), ("{seed: 1}", 16), ("{seed: []}", 16), ("{data.rate: [2], seed: {a: 1}}", 32)],
)
def test_what_is_no_matrix(write, matrix, column):
    (made,) = compose(write(f"name: a\nmatrix: {matrix}"))
    (mistake,) = made.mistakes
    assert (mistake.location.line, mistake.location.column) == (2, column)
    assert "lists of values" in mistake.text


@pytest.mark.parametrize("axis", ["extends", "matrix"])
def test_a_matrix_varies_no_composition(write, axis):
    (made,) = compose(write(f"name: a\nmatrix: {{seed: [1], {axis}: [x, y]}}"))
    (mistake,) = made.mistakes
    assert (mistake.location.line, mistake.location.column) == (2, 21)
    assert mistake.text == f"a matrix cannot vary '{axis}': write it at the top level of the file"


def test_a_study_is_laid_over_each_of_the_recipes_it_names(write):
    write("name: one\nseed: 1\ntrain: {epochs: 9, batch: 2}", "some/one.yaml")
    write("extends: one.yaml\nname: two", "some/two.yaml")
    path = write("""
        name: study
        train: {epochs: 5}
        recipes:
          - some/one.yaml
          - {use: some/two.yaml, train.batch: 4}
          - {use: some/two.yaml, name: three, seed: 7}
    """)
    one, two, three = compose(path, ["train.learning_rate=0.5"])
    assert one.data == {"name": "study-one", "seed": 1, "train": {"epochs": 5, "batch": 2, "learning_rate": 0.5}}
    assert two.data == {"name": "study-two", "seed": 1, "train": {"epochs": 5, "batch": 4, "learning_rate": 0.5}}
    assert three.data == {"name": "study-three", "seed": 7, "train": {"epochs": 5, "batch": 2, "learning_rate": 0.5}}
    assert two.location(("train", "batch")) == Location(str(path), 5, 39)
    assert one.location(("train", "batch")).origin.endswith("one.yaml")


def test_a_study_may_have_a_matrix_too(write):
    write("name: one", "one.yaml")
    write("name: two\nmatrix: {seed: [1]}", "two.yaml")
    runs = list(compose(write("name: study\nrecipes: [one.yaml, two.yaml]\nmatrix: {data.touches: [0, 4]}")))
    assert [run.data["name"] for run in runs] == [
        "study-one-touches.0",
        "study-one-touches.4",
        "study-two-seed.1-touches.0",
        "study-two-seed.1-touches.4",
    ]


@pytest.mark.parametrize(
    ("recipes", "said"),
    [
        ("one.yaml", r"recipe\.yaml:2:10: recipes must be a list of recipe files"),
        ("[]", r"recipe\.yaml:2:10: recipes must be a list of recipe files"),
        ("[3]", r"recipe\.yaml:2:11: a recipe to compare is a file, or"),
        ("[{seed: 3}]", r"recipe\.yaml:2:\d+: a recipe to compare is a file, or"),
        ("[nothing.yaml]", r"recipe\.yaml:2:11: there is no recipe .*nothing\.yaml: it is relative to this file"),
    ],
)
def test_a_study_of_what_is_no_recipe(write, recipes, said):
    with pytest.raises(RecipeError, match=said):
        list(compose(write(f"name: study\nrecipes: {recipes}")))


def test_axes_from_outside_vary_as_a_matrix_does(write):
    path = write("name: a\nmodel: {encoder: net}\nmatrix: {seed: [5], data.touches: [0]}")
    runs = list(compose(path, (), {"model.fusion": ["x", "y"], "seed": [0, 1]}))
    assert [run.data["name"] for run in runs] == [
        f"a-seed.{seed}-touches.0-fusion.{fusion}" for seed in (0, 1) for fusion in ("x", "y")
    ]
    assert runs[1].data["model"] == {"encoder": {"use": "net"}, "fusion": {"use": "y"}}
    assert runs[1].location(("model", "fusion", "use")) == Location("--fusion y")


def test_a_study_names_no_study(write):
    write("name: one", "one.yaml")
    write("name: inner\nrecipes: [one.yaml]", "inner.yaml")
    with pytest.raises(RecipeError, match=r"recipe\.yaml:2:11: .*inner\.yaml is a study itself"):
        list(compose(write("name: study\nrecipes: [inner.yaml]")))


def test_the_recipes_of_an_extended_study_are_where_it_is(write):
    write("name: one", "some/one.yaml")
    write("name: inner\nrecipes: [one.yaml]", "some/study.yaml")
    (made,) = compose(write("extends: some/study.yaml\nname: outer"))
    assert made.data["name"] == "outer-one"


@pytest.mark.parametrize(("text", "seed"), [("name: a", 0), ("name: a\nseed: 4", 4), ("name: a\ndata: {seed: 7}", 7)])
def test_a_seed_that_is_varied_from_outside_leaves_the_data_alone(write, text, seed):
    path = write(text)
    assert [run.data["data"]["seed"] for run in compose(path, (), {"seed": [0, 1]})] == [seed, seed]
    (run,) = compose(path, ["data.seed=9"], {"seed": [1]})
    assert run.data["data"]["seed"] == 9
