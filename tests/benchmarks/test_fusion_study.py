"""benchmarks/fusion_study.py: what is measured of a snapshot, which runs count, and what the tables say."""

import importlib
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from click.testing import CliRunner

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
    study = importlib.import_module("fusion_study")
    study_runs = importlib.import_module("study_runs")
REGISTRY = load_plugins()
OBJECTS = split(3, 5)


@pytest.fixture
def recipe(tmp_path):
    return tiny(tmp_path, "data.touches=2", "train.snapshots=[2, 8]", "model.upsampler.start=neighbours")


@pytest.fixture
def network(recipe):
    return varied(recipe)


@pytest.fixture
def run(tmp_path, recipe, network, monkeypatch):
    """Leave a run of the study with snapshots; its network is measured on `OBJECTS`."""
    calls = []
    monkeypatch.setattr(study, "_test_split", lambda folder: OBJECTS)
    measure = study.measure
    monkeypatch.setattr(study, "measure", lambda *given: calls.append(1) or measure(*given))

    rows = {one.name: one.fingerprint[:8] for one in study_runs.recipes(study.STUDY)}
    monkeypatch.setattr(study_runs, "recipes", lambda name: [as_row(recipe, *row) for row in rows.items()])

    def leave(name, steps=(2, 8), folder=None):
        path = tmp_path / "runs" / (folder or f"{name}-{rows[name]}")
        path.mkdir(parents=True, exist_ok=True)
        for step in steps:
            card = {"name": name, "recipe": recipe.resolved(), "data_fingerprint": "0" * 64}
            save_weights(path / f"weights-{step}.safetensors", network, card)
        return path

    return leave, calls


def as_row(recipe, name, fingerprint):
    """A row of the study with the settings of a recipe."""
    return SimpleNamespace(name=name, fingerprint=fingerprint, train=recipe.train)


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
    numbers = study.measure(network, recipe, OBJECTS)
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


def test_rows_are_those_of_the_study_in_its_order_and_runs_of_one_row_are_its_seeds(run, tmp_path):
    leave, _ = run
    leave("fusions-nearest-seed.1")
    leave("fusions-nearest-seed.0")
    leave("fusions-iterative-seed.0", steps=(2,))
    leave("fusions-iterative-seed.1", folder="fusions-iterative-seed.1-00000000")  # of other settings
    leave("fusions-concat-seed.0", steps=())
    leave("fusions-concat-seed.1", folder="fusions-unknown-seed.0-00000001")
    rows = study.read(tmp_path / "runs", REGISTRY)
    assert {row: {step: len(seeds) for step, seeds in of.items()} for row, of in rows.items()} == {
        "iterative": {2: 1},
        "nearest": {2: 2, 8: 2},
    }
    assert list(rows) == ["iterative", "nearest"]


def test_a_snapshot_is_measured_once_unless_it_changes(run, tmp_path, network):
    leave, calls = run
    path = leave("fusions-pool-seed.0")
    first = study.read(tmp_path / "runs", REGISTRY)
    assert len(calls) == 2
    assert study.read(tmp_path / "runs", REGISTRY) == first
    assert len(calls) == 2
    with torch.no_grad():
        network.upsampler.mlp[-1].weight.normal_()
    leave("fusions-pool-seed.0", steps=(8,))
    again = study.read(tmp_path / "runs", REGISTRY)["pool"]
    assert len(calls) == 3
    assert again[2] == first["pool"][2]
    assert again[8] != first["pool"][8]
    (path / "weights-2.safetensors").unlink()
    assert study.read(tmp_path / "runs", REGISTRY)["pool"] == again
    assert len(calls) == 3


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
def test_a_malformed_file_of_numbers_is_named(run, tmp_path, content, message):
    leave, _ = run
    (leave("fusions-pool-seed.0") / "snapshots.json").write_text(content)
    with pytest.raises(UserError, match=rf"snapshots\.json: .*{message}.*; remove the file"):
        study.read(tmp_path / "runs", REGISTRY)


def test_without_snapshots_it_says_what_makes_some(tmp_path):
    (tmp_path / "runs").mkdir()
    with pytest.raises(UserError, match=r"runs holds no snapshot of the study: `pcsr run fusions/study --runs "):
        study.read(tmp_path / "runs", REGISTRY)


def test_numbers_that_are_kept_are_shown_with_those_of_later_runs(run, tmp_path, monkeypatch):
    leave, calls = run
    monkeypatch.setattr(study_runs, "KEPT", tmp_path / "kept")
    monkeypatch.setattr(study, "KEPT", tmp_path / "kept")
    saved = {}
    monkeypatch.setattr(study, "save", lambda name, command, columns, lines: saved.update({name: lines}))
    for name in ("fusions-pool-seed.0", "fusions-iterative-seed.1"):
        path = leave(name)
        done = CliRunner().invoke(study.main, [str(tmp_path / "runs"), "--save"])
        assert done.exit_code == 0, done.output
        shutil.rmtree(path)
    assert [line[:3] for line in saved["fusion-study"]] == [["`iterative`", "1", "8"], ["`pool`", "1", "8"]]
    assert len(calls) == 4
    assert {path.name for path in (tmp_path / "kept").rglob("*.*") if path.is_file()} == {"snapshots.json"}


def numbers(without, own, other, replaced):
    moved = np.subtract(without, own).tolist()
    of_touch = {"without": without, "own": own, "other": other, "replaced": replaced}
    return {**of_touch, "moved": moved, "features": [2 * one for one in without]}


ROWS = {
    "a": {
        1: [numbers([4e-3, 2e-3], [3e-3, 2e-3], [4e-3, 2e-3], [2e-3, 0.0])] * 2,
        5: [numbers([4e-3, 2e-3], [2e-3, 2e-3], [5e-3, 2e-3], [2e-3, 0.0])],
    },
    "b": {5: [numbers([4e-3, 2e-3], [4e-3, 2e-3], [4e-3, 2e-3], [4e-3, 2e-3])]},
}


def test_a_line_is_of_the_last_step_that_all_seeds_have_reached():
    assert study.table(ROWS) == [
        [
            "`a`",
            "2",
            "1",
            "3.000 ± 0.000",
            "2.500 ± 0.000",
            "3.000 ± 0.000",
            "0.250 ± 0.000",
            "0.000 ± 0.000",
            "0.500 ± 0.000",
            "6.000 ± 0.000",
        ],
        ["`b`", "1", "5", "3.000", "3.000", "3.000", "–", "–", "0.000", "6.000"],
    ]
    assert study.over_steps(ROWS) == [["row", "1", "5"], ["`a`", "0.250 ± 0.000", "0.500"], ["`b`", "–", "–"]]


def test_the_command_prints_the_tables_and_draws_the_picture(run, tmp_path):
    leave, _ = run
    leave("fusions-iterative-seed.0")
    leave("fusions-concat-seed.0")
    done = CliRunner().invoke(study.main, [str(tmp_path / "runs"), "-o", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "| `iterative` | 1     | 8    |" in done.output
    assert (tmp_path / "fusion-study.png").stat().st_size > 1000
