"""What an evaluation leaves: every number of every object, and the first clouds as they are."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open

from pcsr.data.dataset import Split
from pcsr.errors import UserError
from pcsr.experiments.evaluation import Evaluation
from pcsr.experiments.run import examples_of, results_of
from pcsr.geometry.frames import UnitSphere
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.results import MethodResult, write_results
from pcsr.run_files import FinishedRun, read_examples, write_run

SMOKE = Path(__file__).parents[1] / "pcsr/recipes" / "smoke.yaml"
OBJECTS = 3


@pytest.fixture(scope="module")
def registry():
    return load_plugins()


def smoke(registry, *settings):
    (only,) = load(SMOKE, registry, ["data.touches=2", "evaluate.examples=2", "evaluate.metrics=[cd]", *settings])
    return only


@pytest.fixture
def split():
    random = torch.Generator().manual_seed(0)
    truth, touches = (torch.randn(OBJECTS, *shape, 3, generator=random) for shape in ((40,), (3, 8)))
    return Split(
        names=[f"object {k}" for k in range(OBJECTS)],
        groups=["all"] * OBJECTS,
        truth=list(truth),
        points=list(truth[:, ::4].clone()),
        touches=list(touches),
        spheres=[UnitSphere(np.zeros(3), 1.0)] * OBJECTS,
        covered=[(0.1, 0.2, 0.3)] * OBJECTS,
        about={"fingerprint": "f", "rejected": {"object 9": "too small"}},
    )


@pytest.fixture
def evaluation():
    dense = np.random.default_rng(0).normal(size=(OBJECTS, 40, 3))
    method = MethodResult(name="ours", parameters=5, seconds=0.5, values={"cd": [0.1, 0.2, 0.3]})
    return Evaluation([method], None, [dense], [1], None, "as pcsr upsample")


def test_all_numbers_are_there_and_nothing_that_json_does_not_know(registry, split, evaluation, tmp_path):
    results = results_of(smoke(registry), split, evaluation, {"source": "trained by this run"})
    write_results(tmp_path / "results.json", results)
    made = json.loads((tmp_path / "results.json").read_text(encoding="utf-8"))
    assert made == results.model_dump(exclude_unset=True)
    assert list(made) == [
        *("name", "fingerprint", "seed", "version", "recipe", "data", "metrics", "objects", "groups", "methods"),
        *("touch", "training", "protocol", "timing", "hardware", "code", "created"),
    ]
    assert list(made["data"]) == [
        *("shapes", "split", "points", "truth", "rate", "touches", "sampling", "seed", "normalisation"),
        *("object_size", "coverage", "left_out", "fingerprint", "radii"),
    ]
    for radius, points in zip(made["data"]["radii"], split.points, strict=True):
        assert radius == pytest.approx(float(np.linalg.norm(points - points.mean(0), axis=1).__pow__(2).mean() ** 0.5))
    assert made["touch"] is None
    assert made["protocol"] == "as pcsr upsample"
    assert made["hardware"]["load"] is None
    assert made["objects"] == split.names
    (method,) = made["methods"]
    assert method == {"name": "ours", "parameters": 5, "seconds": 0.5, "values": {"cd": [0.1, 0.2, 0.3]}}
    assert made["data"]["left_out"] == 1
    assert made["data"]["coverage"] == pytest.approx(0.2), "of the two touches that are used"
    assert made["training"] == {"source": "trained by this run"}
    assert list(made["metrics"]) == ["cd"]


@pytest.mark.parametrize("touches", [2, 0])
def test_the_first_clouds_are_kept_to_the_last_digit(registry, split, evaluation, tmp_path, touches):
    path, recipe = tmp_path / "examples.safetensors", smoke(registry, f"data.touches={touches}")
    results = results_of(recipe, split, evaluation, {})
    write_run(FinishedRun(tmp_path, results, examples_of(recipe, split, evaluation), None))
    with safe_open(path, "pt") as file:
        assert json.loads(file.metadata()["names"]) == ["object 0", "object 1"]
        parts = ["input", "truth", "ours", *(["touches"] if touches else [])]
        assert set(file.keys()) == {f"{k}/{part}" for k in range(2) for part in parts}
        assert torch.equal(file.get_tensor("1/truth"), split.truth[1])
        assert torch.equal(file.get_tensor("1/ours"), torch.from_numpy(evaluation.dense[0][1]).float())
        if touches:
            assert torch.equal(file.get_tensor("1/touches"), split.touches[1][:2].flatten(0, 1))


def test_an_example_knows_how_many_touches_it_has(registry, split, evaluation, tmp_path):
    fewer = dataclasses.replace(split, touches=[touches[:k] for k, touches in enumerate(split.touches)])
    recipe = smoke(registry)
    results = results_of(recipe, fewer, evaluation, {})
    write_run(FinishedRun(tmp_path, results, examples_of(recipe, fewer, evaluation), None))
    examples = read_examples(tmp_path / "examples.safetensors", ["ours"])
    assert [one.touch_count for one in examples] == [0, 1]
    assert examples[0].touches is None
    assert np.array_equal(examples[1].touches, fewer.touches[1].flatten(0, 1).numpy())


def test_a_card_whose_training_is_damaged_is_refused(registry, split, evaluation):
    with pytest.raises(UserError, match=r"the card of the weights: training: steps: .*train the weights again"):
        results_of(smoke(registry), split, evaluation, {"steps": "many"})
