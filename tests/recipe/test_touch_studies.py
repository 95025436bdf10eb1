"""recipes/touch: the rows that docs/when-touch-helps.md speaks of, and no more data than they need."""

import json
from pathlib import Path

import pytest
import torch

from pcsr import weights
from pcsr.data.plan import Plan
from pcsr.files import save_tensors
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import Registration, load

RECIPES = Path(__file__).parents[2] / "pcsr/recipes"
STUDIES = ("size", "vision", "occlusion", "sensor", "policy")
BESIDE = ("midpoint", "floor")
pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plugins():
    return load_plugins()


@pytest.fixture(scope="module")
def rows(plugins, tmp_path_factory):
    """The recipes of each study, with shipped weights that hold a card and no network."""
    folder = tmp_path_factory.mktemp("weights")
    for name in ("field", "tapsr"):
        (recipe,) = load(RECIPES / "shipped" / f"{name}.yaml", plugins)
        save_tensors(
            folder / f"{name}.safetensors", {"a": torch.zeros(1)}, {"pcsr": json.dumps({"recipe": recipe.resolved()})}
        )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(weights, "HERE", folder)
        return {study: load(RECIPES / "touch" / f"{study}.yaml", plugins) for study in STUDIES}


def test_every_study_of_the_folder_is_known():
    assert {path.stem for path in (RECIPES / "touch").glob("*.yaml")} == {*STUDIES, "parts"}


def test_size(rows):
    varied = [(r.weights.use, r.data.touch.options["object_size"], r.data.touches) for r in rows["size"]]
    sizes = (30.0, 60.0, 120.0, 320.0)
    field = {("field", size, touches) for size in sizes for touches in range(1, 6)}
    assert set(varied) == field | {("tapsr", size, 4) for size in sizes}
    assert len(varied) == 24


def test_vision(rows):
    assert [(r.data.view.noise, r.data.touches) for r in rows["vision"]] == [
        (noise, 4) for noise in (0.0, 0.005, 0.01, 0.02)
    ]
    assert {(r.data.sampling, r.data.view.cameras) for r in rows["vision"]} == {("view", 4)}
    assert all(r.evaluate.baselines == BESIDE for r in rows["vision"])


@pytest.mark.parametrize(
    ("study", "policies", "sampling"),
    [("occlusion", ("sparse", "uniform"), "view"), ("policy", ("uniform", "spread", "sparse", "grasp"), "random")],
)
def test_policies_over_touches(rows, study, policies, sampling):
    varied = [(r.data.touch.options["policy"].use, r.data.touches) for r in rows[study]]
    assert varied == [(policy, touches) for policy in policies for touches in range(1, 6)]
    assert {(r.data.sampling, r.data.view.cameras) for r in rows[study]} == {(sampling, 1)}


def test_sensor(rows):
    def described(r):
        noise, view = r.data.touch.options["noise"], r.data.view
        cloud = (r.data.sampling, view.cameras, view.noise, r.data.touch.options["policy"].use)
        private = (noise.position_noise, noise.rotation_noise)
        return (cloud, private, (noise.shared_position_noise, noise.shared_rotation_noise), noise.depth_noise)

    random, one_side = ("random", 1, 0.0, "uniform"), ("view", 1, 0.0, "sparse")
    noisy = [("view", 4, noise, "uniform") for noise in (0.01, 0.02)]
    exact = (0.0, 0.0)
    errors = [(random, private, exact, 0.02) for private in (exact, (0.5, 1.0), (1.0, 2.0), (2.0, 3.0))]
    errors += [(one_side, exact, exact, 0.02), (one_side, (0.2, 0.3), (1.0, 2.0), 0.02)]
    errors += [(cloud, private, exact, 0.02) for cloud in noisy for private in (exact, (1.0, 2.0))]
    depth = [(described(r), r.data_seed) for r in rows["sensor"][:3]]
    assert depth == [((random, exact, exact, noise), 0) for noise in (0.0, 0.1, 0.3)]
    drawn = [(described(r), r.data.registration, r.data_seed) for r in rows["sensor"][3:]]
    prior = Registration(position=1.0, rotation=2.0)
    assert drawn == [(one, registration, seed) for one in errors for registration in (None, prior) for seed in range(3)]
    assert {r.data.touches for r in rows["sensor"]} == {4}


@pytest.mark.parametrize("study", STUDIES)
def test_all_rows_are_alike_but_for_what_is_studied(rows, study):
    for recipe in rows[study]:
        assert (recipe.data.shapes.use, recipe.data.shapes.options["held_out"]) == ("cad-parts", 24)
        assert study == "sensor" or (recipe.data_seed, recipe.data.registration) == (0, None)
        assert (recipe.evaluate.metrics, recipe.evaluate.objects) == (("cd",), None)
        assert study == "size" or recipe.weights.use == "field"
        assert study == "size" or recipe.data.touch.options["object_size"] == 30.0
    assert len({recipe.name for recipe in rows[study]}) == len(rows[study]), "each has a folder of its own"


def test_baselines_are_measured_once_for_each_clouds_and_size(rows):
    beside = {study: sum(r.evaluate.baselines == BESIDE for r in some) for study, some in rows.items()}
    assert beside == {"size": 4, "vision": 4, "occlusion": 2, "sensor": 0, "policy": 0}


def test_rows_share_their_data(rows, plugins):
    prints = {study: [Plan.of(r, plugins).fingerprint for r in some] for study, some in rows.items()}
    assert {study: len(set(of)) for study, of in prints.items()} == {
        "size": 20,  # the networks share it
        "vision": 4,
        "occlusion": 10,
        "sensor": 63,
        "policy": 20,
    }
    by_name = {r.name: one for study, of in prints.items() for r, one in zip(rows[study], of, strict=True)}
    same = [
        ("size-field-touches.4-object_size.30.0", "policy-policy.uniform-touches.4"),
        ("size-field-touches.4-object_size.30.0", "sensor-arm-error.0.0-registration.none-seed.0"),
        ("occlusion-policy.sparse-touches.4", "sensor-shared-error.0.0-registration.none-seed.0"),
        ("vision-noise.0.02", "sensor-camera-noise.0.02-error.0.0-registration.none-seed.0"),
    ]
    assert all(by_name[one] == by_name[other] for one, other in same)
    sets = {one for of in prints.values() for one in of}
    page = (RECIPES.parents[1] / "docs" / "when-touch-helps.md").read_text(encoding="utf-8")
    assert f"There are {sum(map(len, rows.values()))} rows on {len(sets)} sets of data" in page
