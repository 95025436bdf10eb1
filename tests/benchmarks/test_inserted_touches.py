"""benchmarks/inserted_touches.py: a network without touch, whose result gets the touched points afterwards."""

import importlib
import json
from pathlib import Path

import pytest
import torch

from pcsr.errors import UserError
from pcsr.metrics.chamfer import chamfer
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.run_files import read_results_of
from pcsr.upsample import upsample_as
from tests.small_run import put
from tests.small_training import split, tiny, varied

ROOT = Path(__file__).parents[2]
with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(ROOT / "benchmarks"))
    touches = importlib.import_module("inserted_touches")
OBJECTS = split(8, 5)
REGISTRY = load_plugins()


@pytest.fixture
def alone(tmp_path):
    recipe = tiny(tmp_path, "model.fusion=none", "model.touch_encoder=null", "model.upsampler.start=neighbours")
    return recipe, varied(recipe)


@pytest.fixture
def runs(tmp_path, alone, monkeypatch):
    """Run folders of a network without touch and of one with two touches of each object."""
    monkeypatch.setattr(touches.Split, "load", lambda folder, name: OBJECTS)
    made = []
    with_touches = tiny(tmp_path, "data.touches=2", "model.fusion=edge-conv")
    for name, (recipe, network) in (("alone", alone), ("touched", (with_touches, varied(with_touches)))):
        folder = put(tmp_path / name, name)
        save_weights(folder / "weights.safetensors", network, {"name": name, "recipe": recipe.resolved()})
        made.append(read_results_of(folder))
    return made


def test_touched_points_are_in_the_result_of_the_network_alone(runs, alone):
    found = touches.inserted(*runs, REGISTRY).results
    recipe, network = alone
    for i, truth in enumerate(OBJECTS.truth):
        points, given = OBJECTS.points[i].numpy(), [touch.numpy() for touch in OBJECTS.touches[i]]
        dense = torch.from_numpy(upsample_as(recipe, network, points, [])).float()
        assert found.touch.plain[i] == pytest.approx(float(chamfer(dense[None], truth[None])), rel=1e-5)
        assert found.methods[0].values["cd"][i] < found.touch.plain[i], "touched points lie on the surface"
        assert len(given) == 2
    assert found.recipe["model"]["fusion"] == {"use": "joint-cloud"}
    assert found.name == "alone-inserted"
    assert found.training == runs[0].results.training


def test_it_is_measured_once_unless_weights_or_data_change(runs, monkeypatch):
    calls = []
    evaluate = touches.evaluate
    monkeypatch.setattr(touches, "evaluate", lambda *given, **more: calls.append(1) or evaluate(*given, **more))
    first = touches.inserted(*runs, REGISTRY).results
    assert touches.inserted(*runs, REGISTRY).results.methods == first.methods
    assert len(calls) == 1
    alone, touched = runs
    path = alone.folder / "results.json"
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"training": content["training"] | {"weights": "cd"}}))
    touches.inserted(read_results_of(alone.folder), touched, REGISTRY)
    assert len(calls) == 2


def test_malformed_numbers_are_named(runs):
    (runs[0].folder / "inserted.json").write_text("{")
    with pytest.raises(UserError, match=r"inserted\.json"):
        touches.inserted(*runs, REGISTRY)
