"""What an evaluation leaves: every number of every object, and the first clouds as they are."""

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open

from pcsr.data.dataset import Split
from pcsr.experiments.evaluation import Method, Scores
from pcsr.geometry.frames import UnitSphere
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr.results import gathered, save_examples

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
        felt=[(0.1, 0.2, 0.3)] * OBJECTS,
        about={"fingerprint": "f", "rejected": {"object 9": "too small"}},
    )


@pytest.fixture
def scores(split):
    dense = np.random.default_rng(0).normal(size=(OBJECTS, 40, 3))
    method = Method("ours", 5, lambda points, touches: points)
    return Scores(method, 0.5, {"cd": [0.1, 0.2, 0.3]}, dense)


def test_all_numbers_are_there_and_nothing_that_json_does_not_know(registry, split, scores):
    made = gathered(smoke(registry), split, [scores], {"source": "trained by this run"})
    assert json.loads(json.dumps(made)) == made
    assert made["objects"] == split.names
    (method,) = made["methods"]
    assert method == {"name": "ours", "parameters": 5, "seconds": 0.5, "values": {"cd": [0.1, 0.2, 0.3]}}
    assert made["data"]["left_out"] == 1
    assert made["data"]["coverage"] == pytest.approx(0.2), "of the two touches that are used"
    assert made["training"] == {"source": "trained by this run"}
    assert list(made["metrics"]) == ["cd"]


@pytest.mark.parametrize("touches", [2, 0])
def test_the_first_clouds_are_kept_to_the_last_digit(registry, split, scores, tmp_path, touches):
    path = tmp_path / "examples.safetensors"
    save_examples(path, smoke(registry, f"data.touches={touches}"), split, [scores])
    with safe_open(path, "pt") as file:
        assert json.loads(file.metadata()["names"]) == ["object 0", "object 1"]
        parts = ["input", "truth", "ours", *(["touches"] if touches else [])]
        assert set(file.keys()) == {f"{k}/{part}" for k in range(2) for part in parts}
        assert torch.equal(file.get_tensor("1/truth"), split.truth[1])
        assert torch.equal(file.get_tensor("1/ours"), torch.from_numpy(scores.dense[1]).float())
        if touches:
            assert torch.equal(file.get_tensor("1/touches"), split.touches[1][:2].flatten(0, 1))
