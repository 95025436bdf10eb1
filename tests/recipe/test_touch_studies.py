"""recipes/touch: the rows that docs/when-touch-helps.md speaks of, and no more data than they need."""

import json
from pathlib import Path

import pytest
import torch

from pcsr import weights
from pcsr.data.plan import Plan
from pcsr.files import save_tensors
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load

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
    for name in ("frames", "tapsr"):
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
    frames = {("frames", size, touches) for size in sizes for touches in range(1, 6)}
    assert set(varied) == frames | {("tapsr", size, 4) for size in sizes}
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
    noises = [r.data.touch.options["noise"] for r in rows["sensor"]]
    options = [(noise.depth_noise, noise.position_noise) for noise in noises]
    assert options == [(0.0, 0.0), (0.02, 0.0), (0.1, 0.0), (0.3, 0.0), (0.02, 0.5), (0.02, 1.0), (0.02, 2.0)]
    assert {r.data.touches for r in rows["sensor"]} == {4}


@pytest.mark.parametrize("study", STUDIES)
def test_all_rows_are_alike_but_for_what_is_studied(rows, study):
    for recipe in rows[study]:
        assert (recipe.data_seed, recipe.data.shapes.use, recipe.data.shapes.options["held_out"]) == (
            0,
            "cad-parts",
            24,
        )
        assert (recipe.evaluate.metrics, recipe.evaluate.objects) == (("cd",), None)
        assert study == "size" or recipe.weights.use == "frames"
        assert study == "size" or recipe.data.touch.options["object_size"] == 30.0
    assert len({recipe.name for recipe in rows[study]}) == len(rows[study]), "each has a folder of its own"


def test_baselines_are_measured_once_for_each_clouds_and_size(rows):
    beside = {study: sum(r.evaluate.baselines == BESIDE for r in some) for study, some in rows.items()}
    assert beside == {"size": 4, "vision": 4, "occlusion": 2, "sensor": 0, "policy": 0}


def test_rows_share_their_data(rows, plugins):
    prints = {study: [Plan.of(r, plugins).fingerprint for r in some] for study, some in rows.items()}
    assert {study: len(set(of)) for study, of in prints.items()} == {
        "size": 4,  # the networks and the numbers of touches share it
        "vision": 4,
        "occlusion": 2,
        "sensor": 7,
        "policy": 4,
    }
    at_30 = prints["size"][0]
    assert rows["size"][0].data.touch.options["object_size"] == 30.0
    assert at_30 == prints["sensor"][1] == prints["policy"][0]
    sets = {one for of in prints.values() for one in of}
    page = (RECIPES.parents[1] / "docs" / "when-touch-helps.md").read_text(encoding="utf-8")
    assert f"There are {sum(map(len, rows.values()))} rows on {len(sets)} sets of data" in page
