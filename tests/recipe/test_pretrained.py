"""Recipes that name weights: what is taken from the card, what must agree with it, and where the file is looked for."""

import json
from contextlib import suppress

import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pcsr import weights
from pcsr.contracts import Trait, Upsampler
from pcsr.errors import UserError
from pcsr.files import save_tensors, sha256
from pcsr.plugins.registry import Entry, Registry
from pcsr.recipe import RecipeError, from_resolved, load, pretrained
from pcsr.recipe.json_schema import json_schema
from pcsr.recipe.pretrained import WeightsFile, check_weights

MODEL = "{encoder: {use: net, channels: 4}, fusion: blend, backbone: refine, upsampler: dense}"


@pytest.fixture
def trained(write, registry, tmp_path):
    """Weights of a small network, beside the recipes; its recipe."""

    def train(*overrides, name="w.safetensors"):
        path = write(f"name: teacher\nmodel: {MODEL}\ntrain: {{epochs: 7, touches: [0, 2]}}", f"of-{name}.yaml")
        (recipe,) = load(path, registry, overrides)
        card = {"recipe": recipe.resolved(), "training": {"steps": 3}}
        save_tensors(tmp_path / name, {"a": torch.zeros(1)}, {"pcsr": json.dumps(card)})
        return recipe

    return train


def one(path, registry, *overrides):
    (recipe,) = load(path, registry, overrides)
    return recipe


@pytest.fixture(autouse=True)
def elsewhere(tmp_path_factory, monkeypatch):
    """No recipe lies where we are, so that what is relative to what shows."""
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))


def test_what_a_recipe_leaves_out_is_taken_from_the_card(write, registry, trained):
    teacher = trained("patches={points: 64, rate: 2}", "data.rate=4")
    made = one(write("name: a\nweights: w.safetensors\ndata: {rate: 8, touches: 1}"), registry)
    assert (made.model, made.patches, made.train) == (teacher.model, teacher.patches, teacher.train)
    assert (made.name, made.data.rate, made.data.touches) == ("a", 8, 1)
    assert made.weights.use.endswith("w.safetensors")


def test_the_rate_is_that_of_the_weights_unless_the_recipe_says_another(write, registry, trained):
    trained("data.rate=4", "data.points=64")
    made = one(write("name: a\nweights: w.safetensors\ndata: {touches: 1}"), registry)
    assert (made.data.rate, made.data.points, made.data.touches) == (4, 512, 1)
    with pytest.raises(RecipeError, match=r"data.rate is 16, and the weights have rate 4"):
        load(write("name: a\nweights: w.safetensors\ndata: {rate: 16}"), registry)


def test_train_is_that_of_the_weights_whatever_it_says(write, registry, trained):
    teacher = trained()
    made = one(write("name: a\nweights: w.safetensors\ntrain: {epochs: 99, touches: 3}"), registry)
    assert made.train == teacher.train
    with pytest.raises(RecipeError, match="takes no 'epoch': did you mean 'epochs'"):
        load(write("name: a\nweights: w.safetensors\ntrain: {epoch: 99}"), registry)


def test_without_weights_nothing_changes(write, registry, trained):
    trained()
    path = write(f"name: a\nmodel: {MODEL}")
    assert one(path, registry).weights is None
    assert one(path, registry) == one(
        write("name: a\nweights: w.safetensors"), registry, "weights=null", f"model={MODEL}"
    )


DIFFERENT = {
    "model: {encoder: net, fusion: blend, backbone: refine, upsampler: dense}": (
        r"yaml:2:18: model.encoder.channels is 8, and the weights were trained with 4: leave out `model`"
    ),
    f"model: {MODEL[:-1]}, touch_encoder: net}}": r"model.touch_encoder is {.*}, and the weights .* with null",
    MODEL.join(("model: ", "")).replace("blend", "{use: attention, heads: 1}"): (
        r'yaml:2:57: model.fusion.use is "attention", and the weights were trained with "blend"'
    ),
    "patches: {points: 32}": r'patches is {"points": 32, "rate": 4}, and the weights .* with null: leave out `patches`',
    "data: {rate: 8}": r"yaml:2:14: data.rate is 8, and the weights have rate 16: take `rate: 16`",
}


@pytest.mark.parametrize("text", DIFFERENT)
def test_the_first_difference_is_named_at_its_place(write, registry, trained, text):
    trained()
    with pytest.raises(RecipeError, match=DIFFERENT[text]) as caught:
        load(write(f"name: a\n{text}\nweights: w.safetensors"), registry)
    assert len(caught.value.mistakes) == 1


def test_other_patches_are_refused_but_how_often_they_cover_is_free(write, registry, trained):
    trained("patches={points: 64, rate: 4}")
    path = write("name: a\nweights: w.safetensors\npatches: {points: 64, rate: 4, overlap: 1.5}")
    assert one(path, registry).patches.overlap == 1.5
    with pytest.raises(RecipeError, match=r"patches.points is 32, and the weights were trained with 64"):
        load(path, registry, ["patches.points=32"])
    with pytest.raises(RecipeError, match="patches is null"):
        load(path, registry, ["patches=null"])
    with pytest.raises(RecipeError, match=r"no power of it is data.rate, 8"):
        load(path, registry, ["data.rate=8"])


def test_an_upsampler_of_any_rate_serves_any_rate(write, registry, trained):
    class Free(Upsampler):
        traits = frozenset({Trait.ANY_RATE})

    free = Registry(dict(registry.entries))
    free.entries["upsampler", "dense"] = Entry("upsampler", "dense", Free, "tests", "1")
    trained()
    path = write("name: a\nweights: w.safetensors\ndata: {rate: 8}")
    assert one(path, free).data.rate == 8


def test_a_file_is_relative_to_the_recipe_that_says_so(write, registry, trained, tmp_path):
    trained(name="below/w.safetensors")
    path = write("name: parent\nweights: w.safetensors", "below/parent.yaml")
    child = write("extends: below/parent.yaml\nname: child")
    assert one(child, registry).weights == one(path, registry).weights
    assert one(child, registry, f"weights={tmp_path}/below/w.safetensors").weights == one(path, registry).weights
    with pytest.raises(
        RecipeError, match=r"no weights 'w.safetensors', neither shipped ones nor a file or run folder w.safe"
    ):
        load(child, registry, ["weights=w.safetensors"])  # relative to where we are


def test_studies_and_matrices_vary_weights(write, registry, trained):
    trained()
    trained("model.encoder.channels=2", name="other.safetensors")
    write(f"name: plain\nmodel: {MODEL}", "plain.yaml")
    write("name: bare", "bare.yaml")
    rows = "- plain.yaml\n  - {use: plain.yaml, name: done, weights: w.safetensors}\n"
    rows += "  - {use: bare.yaml, name: free, weights: other.safetensors}"
    study = load(write(f"name: s\nrecipes:\n  {rows}"), registry)
    assert [(run.name, run.weights is None) for run in study] == [
        ("s-plain", True),
        ("s-done", False),
        ("s-free", False),
    ]
    assert [run.model.encoder.options["channels"] for run in study] == [4, 4, 2]
    matrix = load(write("name: m\nmatrix: {weights: [w.safetensors, other.safetensors]}"), registry)
    assert [run.name for run in matrix] == ["m-weights.w.safetensors", "m-weights.other.safetensors"]
    assert [run.fingerprint for run in matrix] == [run.fingerprint for run in study[1:]]
    assert len({run.fingerprint for run in study}) == 3


def test_shipped_weights_go_by_name_before_any_file(write, registry, trained, tmp_path, monkeypatch):
    trained(name="shipped/known.safetensors")
    trained("model.encoder.channels=2", name="known")
    monkeypatch.setattr(weights, "HERE", tmp_path / "shipped")
    made = one(write("name: a\nweights: known"), registry)
    assert (made.weights.use, made.model.encoder.options["channels"]) == ("known", 4)
    with pytest.raises(RecipeError, match=r"yaml:2:10: there are no weights 'knwn', .*: did you mean 'known'\?"):
        load(write("name: a\nweights: knwn"), registry)


def test_the_fingerprint_hangs_on_the_file_and_not_on_its_name_or_on_train(write, registry, trained, tmp_path):
    trained()
    path = write("name: a\nweights: w.safetensors")
    made = one(path, registry)
    assert made.weights.sha256 == sha256(tmp_path / "w.safetensors")
    (tmp_path / "copy.safetensors").write_bytes((tmp_path / "w.safetensors").read_bytes())
    copied = write("name: a\nweights: copy.safetensors\ntrain: {epochs: 1}", "b.yaml")
    assert one(copied, registry).fingerprint == made.fingerprint
    assert one(path, registry, "data.points=256").fingerprint != made.fingerprint
    trained("train.epochs=8")  # of another file
    assert one(path, registry).fingerprint != made.fingerprint


def test_the_resolved_form_comes_back_and_holds_the_file_to_its_hash(write, registry, trained):
    trained()
    made = one(write("name: a\nweights: w.safetensors"), registry)
    plain = json.loads(json.dumps(made.resolved()))
    assert from_resolved(plain, registry) == made
    again = write(json.dumps(plain), "again.yaml")
    assert one(again, registry) == made
    trained("train.epochs=8")
    with pytest.raises(RecipeError, match=r"have the hash .*…, but weights\.sha256 is .*: get the file with this hash"):
        load(again, registry)


BAD = {
    "3": r"yaml:2:10: weights must be shipped weights \(.*tapsr.*\) or a file, got 3",
    "''": 'or a file, got ""',
    "[a]": r"or a file, got \[\"a\"\]",
    "{sha256: x}": 'or a file, got {"sha256": "x"}',
    "{use: w.safetensors, file: b}": "weights takes no 'file'",
    "none.safetensors": "no weights .none.safetensors., neither shipped ones nor a file or run folder .*/none.safe",
    ".": "is a folder, not a weights file",
    "recipe.yaml": "recipe.yaml is not a weights file of pcsr",
    "bare.safetensors": "holds no recipe",
    "alien.safetensors": "recipe in .*alien.safetensors: there is no fusion 'magic': known",
}


@pytest.mark.parametrize("written", BAD)
def test_what_names_no_weights_is_refused_beside_all_other_mistakes(write, registry, trained, written, tmp_path):
    plain = trained().resolved()
    plain["model"]["fusion"]["use"] = "magic"
    for name, card in (("bare", {}), ("alien", {"recipe": plain})):
        save_tensors(tmp_path / f"{name}.safetensors", {}, {"pcsr": json.dumps(card)})
    with pytest.raises(RecipeError, match=BAD[written]) as caught:
        load(write(f"name: a\nweights: {written}\nsede: 3", model=True), registry)
    assert "takes no 'sede'" in str(caught.value)
    assert len(caught.value.mistakes) == 2


def test_weights_that_change_after_the_recipe_was_read_are_refused(write, registry, trained):
    trained()
    made = one(write("name: a\nweights: w.safetensors"), registry)
    held = check_weights(made, registry)
    assert (held.recipe.name, held.sha256) == ("teacher", made.weights.sha256)
    slower = made.model_copy(update={"data": made.data.model_copy(update={"rate": 8})})
    with pytest.raises(UserError, match=r"recipe 'a': data.rate is 8, and the weights have rate 16"):
        check_weights(slower, registry)
    trained("train.epochs=8")
    with pytest.raises(UserError, match="have changed since the recipe 'a' was read"):
        check_weights(made, registry)
    assert check_weights(made.model_copy(update={"weights": None}), registry) is None


def test_the_file_is_read_and_hashed_once_unless_it_changes(write, registry, trained, monkeypatch):
    hashed = []
    monkeypatch.setattr(pretrained, "sha256", lambda path: hashed.append(path) or sha256(path))
    trained()
    path = write("name: a\nweights: w.safetensors")
    made = one(path, registry)
    first, again = check_weights(made, registry), check_weights(one(path, registry), registry)
    assert (first is again, len(hashed)) == (True, 1)
    first.check_unchanged()
    trained()  # the same bytes in another file
    with pytest.raises(UserError, match="have changed since they were checked: run it again"):
        first.check_unchanged()
    assert check_weights(made, registry).sha256 == first.sha256
    assert len(hashed) == 2


def test_a_file_that_changes_while_it_is_hashed_is_refused(write, registry, trained, monkeypatch):
    trained()
    monkeypatch.setattr(pretrained, "sha256", lambda path: trained("train.epochs=8") and sha256(path))
    with pytest.raises(RecipeError, match="have changed since they were checked"):
        load(write("name: a\nweights: w.safetensors"), registry)


def test_the_run_folder_of_weights_may_be_named(write, registry, trained, tmp_path):
    trained(name="run/weights.safetensors")
    made = one(write("name: a\nweights: run"), registry)
    assert made.weights.use == str(tmp_path / "run" / "weights.safetensors")


def test_the_weights_themselves_are_not_read(registry, trained, tmp_path):
    trained()
    assert WeightsFile.read(tmp_path / "w.safetensors", registry).recipe.train.epochs == 7


def test_editors_take_a_name_for_weights(registry):
    schema = json_schema(registry)
    kinds = [form.get("type", form.get("$ref")) for form in schema["properties"]["weights"]["anyOf"]]
    assert kinds == ["string", "#/$defs/Weights", "null"]


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=5),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.sampled_from(["use", "encoder", "rate", "points", "touches", "objective", "x"]), inner)
    ),
    max_leaves=6,
)


@pytest.mark.filterwarnings("ignore::pcsr.errors.PcsrWarning")  # of names of 0.1, some of which are drawn
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=60)
@given(section=st.sampled_from(["data", "model", "train", "patches", "weights", "name", "recipes"]), value=JSON)
def test_a_card_of_nonsense_is_a_mistake_and_no_crash(write, registry, trained, tmp_path, section, value):
    plain = trained().resolved() | {section: value}
    save_tensors(tmp_path / "w.safetensors", {}, {"pcsr": json.dumps({"recipe": plain})})
    path = write("name: a\nweights: w.safetensors")
    with suppress(RecipeError):
        assert one(path, registry).weights is not None


def test_training_may_start_from_weights_whose_hash_is_part_of_the_fingerprint(write, registry, trained, tmp_path):
    trained()
    plain = write(f"name: a\nmodel: {MODEL}", "plain.yaml")
    path = write(f"name: a\nmodel: {MODEL}\ntrain: {{start: w.safetensors}}")
    made = one(path, registry)
    assert made.train.start.use.endswith("w.safetensors")
    assert made.train.start.sha256 == sha256(tmp_path / "w.safetensors")
    assert made.fingerprint != one(plain, registry).fingerprint
    assert one(plain, registry).train.start is None
    assert from_resolved(made.resolved(), registry) == made
    trained("train.epochs=9")
    assert one(path, registry).fingerprint != made.fingerprint, "other weights under the same name"


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ("nothing", r"yaml:3:\d+: there are no weights 'nothing'"),
        ("3", r"train.start must be shipped weights \(.*\) or a file, got 3"),
        ("{use: w.safetensors, sha256: " + "a" * 64 + "}", r"but train.start.sha256 is aaaaaaaaaaaa…: get the file"),
        ("{used: w.safetensors}", r"train.start must be shipped weights"),
    ],
)
def test_weights_to_start_from_that_do_not_exist_are_a_mistake_in_the_file(write, registry, trained, start, message):
    trained()
    with pytest.raises(RecipeError, match=message):
        load(write(f"name: a\nmodel: {MODEL}\ntrain: {{start: {start}}}"), registry)


def test_weights_that_were_trained_from_others_need_those_no_more(write, registry, trained, tmp_path):
    trained(name="first.safetensors")
    trained("train.start=" + str(tmp_path / "first.safetensors"))
    (tmp_path / "first.safetensors").unlink()
    assert one(write("name: a\nweights: w.safetensors"), registry).train.start.use.endswith("first.safetensors")
