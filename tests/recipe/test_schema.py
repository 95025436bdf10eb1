"""What a checked recipe says: defaults, options, the resolved form and the fingerprints."""

import json
from pathlib import Path
from typing import Annotated, Literal

import pytest
from annotated_types import Ge
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from pcsr.contracts import Widths
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import PartSpec, RecipeError, from_resolved, load
from pcsr.recipe.schema import options_model

TAPSR = Path(__file__).parents[2] / "pcsr" / "recipes" / "tapsr.yaml"


def recipe(write, registry, text="name: a", overrides=()):
    (made,) = load(write(text, model=True), registry, overrides)
    return made


def test_defaults_are_filled_in(write, registry):
    made = recipe(write, registry)
    assert made.resolved() == {
        "name": "a",
        "seed": 0,
        "data": {
            "shapes": {"use": "cad-parts", "count": 10},
            "touch": {"use": "digit", "points": 32},
            "touches": 4,
            "points": 512,
            "rate": 16,
            "truth": "poisson",
            "sampling": "random",
            "view": {"cameras": 1, "noise": 0.0, "distance": 3.0, "pixels": 160},
            "registration": None,
            "seed": None,
        },
        "model": {
            "encoder": {"use": "net", "channels": 8, "order": "hilbert", "layers": [1, 2], "dropout": None},
            "touch_encoder": None,
            "fusion": {"use": "blend"},
            "backbone": {"use": "refine", "steps": 3},
            "upsampler": {"use": "dense"},
        },
        "patches": None,
        "train": {
            "objective": {"use": "chamfer"},
            "epochs": 300,
            "batch": 32,
            "optimizer": {"use": "adam"},
            "learning_rate": 1e-3,
            "schedule": "steps",
            "decay": 0.7,
            "decay_every": None,
            "final_learning_rate": 0.0,
            "warmup": 0.0,
            "clip_norm": None,
            "average": None,
            "augment": ["redraw", "even", "rotate", "scale", "jitter"],
            "touches": None,
            "precision": "32-true",
            "validate_every": None,
            "patience": None,
            "snapshots": [],
            "start": None,
            "loggers": [{"use": "jsonl"}],
        },
        "weights": None,
        "joined": [],
        "evaluate": {
            "metrics": ["cd", "hd", "emd"],
            "baselines": ["midpoint"],
            "objects": None,
            "examples": 4,
            "published": {},
        },
    }


def test_a_resolved_recipe_comes_back_the_same(write, registry):
    changes = [
        "model.encoder.layers=[4]",
        "train.touches=[0, 3]",
        "train.augment=[]",
        "model.encoder.dropout=0.5",
    ]
    made = recipe(write, registry, overrides=changes)
    again = from_resolved(json.loads(json.dumps(made.resolved())), registry)
    assert again == made
    assert again.fingerprint == made.fingerprint


def test_a_resolved_recipe_of_other_parts_is_refused(write, registry):
    plain = recipe(write, registry).resolved()
    plain["model"]["fusion"] = {"use": "magic"}
    with pytest.raises(RecipeError, match=r"^recipe in the weights: there is no fusion 'magic': known: attention"):
        from_resolved(plain, registry)


def test_a_part_is_built_from_its_options(write, registry):
    made = recipe(write, registry, overrides=["model.encoder={use: net, channels: 4, layers: [7, 8]}"])
    net = made.model.encoder.build(registry, "encoder", Widths())
    assert (type(net).__name__, net.channels, net.layers) == ("Net", 4, (7, 8))
    assert made.data.shapes.build(registry, "shapes").count == 10
    assert PartSpec(use="chamfer").build(registry, "objective") is not None


WEIGHTS_CHANGE = ["seed=1", "data.points=256", "data.rate=8", "data.shapes.count=11", "data.sampling=fps"]
WEIGHTS_CHANGE += ["model.encoder.channels=16", "model.fusion={use: attention, heads: 1}", "train.epochs=1"]
WEIGHTS_CHANGE += ["train.touches=[0, 4]", "train.augment=[]", "train.touches=3", "data.touches=5"]
WEIGHTS_CHANGE += ["patches={points: 64}", "train.snapshots=[100]"]
WEIGHTS_STAY = [
    "patches=null",
    "name=b",
    "evaluate.metrics=[cd]",
    "evaluate.examples=1",
    "train.touches=4",
    "train.touches=[4, 4]",
]


@pytest.mark.parametrize("change", WEIGHTS_CHANGE)
def test_the_fingerprint_tells_what_decides_the_weights(write, registry, change):
    assert recipe(write, registry, overrides=[change]).fingerprint != recipe(write, registry).fingerprint


@pytest.mark.parametrize("change", WEIGHTS_STAY)
def test_the_fingerprint_is_blind_to_the_rest(write, registry, change):
    assert recipe(write, registry, overrides=[change]).fingerprint == recipe(write, registry).fingerprint


def test_touches_at_evaluation_do_not_decide_the_weights_if_training_has_its_own(write, registry):
    text = "name: a\ntrain: {touches: [0, 5]}"
    few, many = (recipe(write, registry, text, [f"data.touches={count}"]) for count in (1, 5))
    assert few.fingerprint == many.fingerprint


@pytest.mark.parametrize(
    ("train", "evaluation", "touch_range", "most"),
    [("null", 4, (4, 4), 4), ("2", 4, (2, 2), 4), ("[0, 5]", 4, (0, 5), 5), ("[0, 0]", 0, (0, 0), 0)],
)
def test_touch_range(write, registry, train, evaluation, touch_range, most):
    made = recipe(write, registry, overrides=[f"train.touches={train}", f"data.touches={evaluation}"])
    assert (made.touch_range, made.most_touches) == (touch_range, most)


def test_the_data_may_have_a_seed_of_its_own(write, registry):
    assert recipe(write, registry, overrides=["seed=3"]).data_seed == 3
    assert recipe(write, registry, overrides=["seed=3", "data.seed=0"]).data_seed == 0


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=20, deadline=None)
@given(epochs=st.integers(1, 10**6), rate=st.floats(1e-12, 1e3), low=st.integers(0, 16), high=st.integers(0, 16))
def test_numbers_survive_the_file_the_header_and_back(write, registry, epochs, rate, low, high):
    low, high = sorted((low, high))
    text = f"name: a\ntrain: {{epochs: {epochs}, learning_rate: {rate!r}, touches: [{low}, {high}]}}"
    made = recipe(write, registry, text)
    assert (made.train.epochs, made.train.learning_rate, made.touch_range) == (epochs, rate, (low, high))
    assert from_resolved(json.loads(json.dumps(made.resolved())), registry) == made


def test_a_recipe_does_not_change(write, registry):
    made = recipe(write, registry)
    with pytest.raises(ValidationError, match="frozen"):
        made.train.epochs = 2


class Sample:
    def __init__(
        self,
        widths: object,
        positional: int = 1,
        *,
        needed: Annotated[int, Ge(2)],
        mode: Literal["a", "b"] = "a",
        pairs: tuple[tuple[int, int], ...] | None = None,
        model_size: float = 1.0,
        table: dict[str, list[int]] | None = None,
    ) -> None:
        pass


def test_options_are_the_keywords_of_the_constructor():
    model = options_model(Sample)
    assert list(model.model_fields) == ["needed", "mode", "pairs", "model_size", "table"]
    made = model(needed=2, pairs=((1, 2),), table={"a": [1]})
    assert made.model_dump() == {
        "needed": 2, "mode": "a", "pairs": ((1, 2),), "model_size": 1.0, "table": {"a": [1]}
    }  # fmt: skip


@pytest.mark.parametrize(
    "options", [{}, {"needed": 1}, {"needed": "2"}, {"needed": 2, "mode": "c"}, {"needed": 2, "widths": 1}]
)
def test_options_of_the_wrong_kind_are_refused(options):
    with pytest.raises(ValidationError):
        options_model(Sample).model_validate_json(json.dumps(options))


def test_lists_become_tuples_where_the_constructor_wants_them():
    text = '{"needed": 2, "pairs": [[1, 2], [3, 4]], "table": {"a": [1]}}'
    made = options_model(Sample).model_validate_json(text)
    assert (made.pairs, made.table) == (((1, 2), (3, 4)), {"a": [1]})


def test_a_part_without_a_constructor_has_no_options():
    assert options_model(type("Bare", (), {})).model_fields == {}


def test_an_option_without_a_type_is_refused():
    class Untyped:
        def __init__(self, *, size=3):
            pass

    with pytest.raises(TypeError, match="option 'size' of Untyped has no type: annotate it"):
        options_model(Untyped)


def test_what_the_network_sees_is_a_patch_or_the_whole(write, registry):
    whole, cut = recipe(write, registry), recipe(write, registry, overrides=["patches={points: 64, rate: 2}"])
    assert (whole.network_points, whole.network_rate) == (512, 16)
    assert (cut.network_points, cut.network_rate) == (64, 2)


def test_how_often_patches_cover_a_cloud_does_not_decide_the_weights(write, registry):
    once, thrice = (recipe(write, registry, overrides=[f"patches={{overlap: {cover}}}"]) for cover in ("1.0", "3.0"))
    assert once.fingerprint == thrice.fingerprint


def test_a_recipe_without_a_model_gets_that_of_tapsr(write):
    registry = load_plugins()
    (tapsr,), (bare,) = load(TAPSR, registry), load(write("name: bare"), registry)
    assert bare.model == tapsr.model
    for name in ("shapes", "touch"):
        assert getattr(bare.data, name).use == getattr(tapsr.data, name).use
    assert bare.train.objective == tapsr.train.objective
    for name in ("points", "rate", "touches", "truth", "sampling"):
        assert getattr(bare.data, name) == getattr(tapsr.data, name)
