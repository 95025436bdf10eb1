"""benchmarks/study_snapshots.py: what is measured of a snapshot, and when."""

import importlib
from pathlib import Path

import numpy as np
import pytest
import torch

from pcsr.data.sample import covered_points
from pcsr.errors import UserError
from pcsr.geometry.frames import UnitSphere
from pcsr.metrics.chamfer import chamfer
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.upsample import upsample_as
from tests.small_training import split, tiny, varied

ROOT = Path(__file__).parents[2]
with pytest.MonkeyPatch.context() as patch:
    patch.syspath_prepend(str(ROOT / "benchmarks"))
    snapshots = importlib.import_module("study_snapshots")
REGISTRY = load_plugins()
OBJECTS = split(3, 5)
STEPS = (2, 8)


@pytest.fixture
def recipe(tmp_path):
    return tiny(tmp_path, "data.touches=2", "model.upsampler.start=neighbours")


@pytest.fixture
def network(recipe):
    return varied(recipe)


@pytest.fixture
def leave(tmp_path, recipe, network, monkeypatch):
    """Leave snapshots in a run folder; the network is measured on `OBJECTS`."""
    monkeypatch.setattr(snapshots, "_test_split", lambda folder: OBJECTS)

    def left(steps=STEPS):
        for step in steps:
            card = {"name": "row", "recipe": recipe.resolved(), "data_fingerprint": "0" * 64}
            save_weights(tmp_path / f"weights-{step}.safetensors", network, card)
        return tmp_path

    return left


@pytest.fixture
def calls(monkeypatch):
    """A list that grows by one for each measurement."""
    made, measure = [], snapshots.measure
    monkeypatch.setattr(snapshots, "measure", lambda *given: made.append(1) or measure(*given))
    return made


def with_features(network, points, other):
    """A cloud of which only the coordinates are its own."""
    (own, sphere), (foreign, _) = (unit(cloud) for cloud in (points, other))
    with torch.inference_mode():
        refined = network.backbone(own[None], network.encoder(foreign[None]))
        return torch.from_numpy(sphere.denormalize(network.upsampler(own[None], refined, 4)[0].numpy())).float()


def unit(cloud):
    sphere = UnitSphere.fit(cloud.numpy())
    return torch.from_numpy(sphere.normalize(cloud.numpy())).float(), sphere


def test_an_object_is_measured_without_touch_with_its_touches_and_with_those_of_the_next(recipe, network):
    numbers = snapshots.measure(network, recipe, OBJECTS)
    touches = [list(some.numpy()) for some in OBJECTS.touches]
    for i, truth in enumerate(OBJECTS.truth):
        wanted = {"without": [], "own": touches[i], "other": touches[(i + 1) % 3]}
        dense = {
            name: torch.from_numpy(upsample_as(recipe, network, OBJECTS.points[i].numpy(), some)).float()
            for name, some in wanted.items()
        }
        assert numbers["features"][i] == pytest.approx(
            float(chamfer(with_features(network, OBJECTS.points[i], OBJECTS.points[(i + 1) % 3])[None], truth[None])),
            rel=1e-5,
        )
        near = torch.cdist(dense["without"], truth).argmin(1)
        region = torch.from_numpy(covered_points(truth.numpy(), touches[i]).any(0))
        dense["replaced"] = torch.cat([dense["without"][~region[near]], truth[region]])
        for name, cloud in dense.items():
            assert numbers[name][i] == pytest.approx(float(chamfer(cloud[None], truth[None])), rel=1e-5), name
        moved = chamfer(dense["own"][None], dense["without"][None])
        assert numbers["moved"][i] == pytest.approx(float(moved), rel=1e-5)
    assert len(set(np.round([numbers[name][0] for name in numbers], 9))) == 6


def test_a_snapshot_is_measured_once_unless_it_changes(leave, calls, network):
    folder = leave()
    first = snapshots.measured(folder, STEPS, REGISTRY)
    assert len(calls) == 2
    assert snapshots.measured(folder, STEPS, REGISTRY) == first
    assert len(calls) == 2
    with torch.no_grad():
        network.upsampler.mlp[-1].weight.normal_()
    leave(steps=(8,))
    again = snapshots.measured(folder, STEPS, REGISTRY)
    assert len(calls) == 3
    assert again[2] == first[2]
    assert again[8] != first[8]


def test_numbers_stay_when_the_weights_are_removed(leave, calls):
    folder = leave()
    first = snapshots.measured(folder, (*STEPS, 20), REGISTRY)
    assert list(first) == [2, 8]
    for path in folder.glob("weights-*"):
        path.unlink()
    assert snapshots.measured(folder, STEPS, REGISTRY) == first
    assert len(calls) == 2


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "it is no JSON"),
        ("[]", "it must be a mapping"),
        ('{"weights-2.safetensors": {"cd": {}}}', "sha256: field required"),
        ('{"weights-2.safetensors": {"sha256": "0", "cd": {"own": [1.0]}}}', "must have without, own, other"),
        ('{"weights-2.safetensors": {"sha256": "0", "cd": {"own": [NaN]}}}', "finite number"),
    ],
)
def test_a_malformed_file_of_numbers_is_named(leave, content, message):
    folder = leave()
    (folder / "snapshots.json").write_text(content)
    with pytest.raises(UserError, match=rf"snapshots\.json: .*{message}.*; remove the file"):
        snapshots.measured(folder, STEPS, REGISTRY)
