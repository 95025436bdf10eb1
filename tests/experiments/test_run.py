import json
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from lightning_fabric import Fabric
from rich.progress import Progress
from safetensors.torch import load_file

from pcsr import Logger
from pcsr.data.dataset import Split
from pcsr.errors import PcsrWarning
from pcsr.experiments.run import _history, packages
from pcsr.experiments.run_options import RunOptions, run_folder
from pcsr.experiments.trained_network import trained
from pcsr.geometry.frames import UnitSphere
from pcsr.network.build import build
from pcsr.network.load import load_weights
from pcsr.network.save import save_weights
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Entry
from pcsr.recipe import load
from pcsr.recipe.section import PartSpec
from pcsr.recipe.train_section import Weights
from pcsr.weights.file import tensors_hash

ROOT = Path(__file__).parents[2]
TINY = [
    "data.points=64", "model.encoder.channels=8", "model.touch_encoder.channels=4", "model.backbone.channels=[8, 16]",
    "train.epochs=3", "train.batch=4", "model.upsampler={use: shuffle, start: origin}",
]  # fmt: skip


@pytest.fixture(scope="module")
def registry():
    return load_plugins()


@pytest.fixture(scope="module")
def recipe(registry):
    return load(ROOT / "pcsr/recipes/smoke.yaml", registry, TINY)[0]


@pytest.fixture(scope="module")
def split():
    generator = torch.Generator().manual_seed(0)
    truth = torch.nn.functional.normalize(torch.randn(8, 256, 3, generator=generator), dim=-1)
    names = [str(i) for i in range(8)]
    touched = truth[:, :60].reshape(8, 2, 30, 3)
    spheres = [UnitSphere.fit(cloud.numpy()) for cloud in truth]
    return Split(
        names, names, list(truth), list(truth[:, 100:164]), list(touched), spheres, [(0.1, 0.2)] * 8, {"rejected": {}}
    )


class Events(Logger):
    """Writes into a folder of its own, as loggers of others do."""

    needs = frozenset({"no_such_package"})

    def start(self, folder, recipe, step):
        (folder / "events").mkdir(exist_ok=True)
        self.path = folder / "events" / "steps.txt"

    def log(self, step, values):
        with self.path.open("a") as file:
            file.write(f"{step}\n")


def weights(network):
    return torch.cat([p.detach().flatten() for p in network.parameters()])


def fabric():
    return Fabric(accelerator="cpu", devices=1)


@pytest.mark.parametrize("name", [path.stem for path in (ROOT / "pcsr/weights").glob("*.safetensors")])
def test_shipped_weights_are_those_of_their_recipe(name, registry):
    path = ROOT / f"pcsr/weights/{name}.safetensors"
    _, recipe, card = load_weights(path, registry)
    (written,) = load(ROOT / f"pcsr/recipes/shipped/{name}.yaml", registry)
    assert (recipe.model, recipe.train, recipe.seed) == (written.model, written.train, written.seed)
    assert card["fingerprint"] == recipe.fingerprint
    assert len(card["data"]) == len(recipe.joined) == (4 if name == "field" else 3), "each data set, for the model card"
    assert path.stat().st_size < 8e6


def call(*words, head=()):
    """What a command prints that ends well."""
    command = [*head, Path(sys.executable).with_name("pcsr"), *words]
    done = subprocess.run([str(word) for word in command], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def settings(*those):
    return [word for setting in those for word in ("--set", setting)]


def test_a_damaged_history_costs_the_chart_of_the_training_alone(tmp_path):
    assert _history(tmp_path) is None
    (tmp_path / "metrics.jsonl").write_text('{"step": 1, "loss": 1}\n')
    assert _history(tmp_path) == [{"step": 1, "loss": 1}]
    (tmp_path / "metrics.jsonl").write_text("{}\n")
    with pytest.warns(PcsrWarning, match=r"metrics\.jsonl:1: not a line .*the report lacks the training; --retrain"):
        assert _history(tmp_path) is None


@pytest.mark.slow
def test_the_whole_way_as_a_person_goes_it(tmp_path):
    plugin = tmp_path / "mine.py"
    plugin.write_text(
        "from pcsr import Fusion, hookimpl\n"
        "class Mine(Fusion):\n"
        "    def __init__(self, widths):\n        super().__init__()\n"
        "    def forward(self, points, features, touches):\n        return features + touches.flat.mean()\n"
        "@hookimpl\ndef pcsr_register(register):\n    register.fusion('mine', Mine)\n"
    )
    small = ["data.shapes.count=4", "data.shapes.held_out=2", "train.epochs=1", "train.batch=2", "model.fusion=mine"]
    words = ["run", ROOT / "pcsr/recipes/smoke.yaml", "--runs", tmp_path / "r", "--plugin", plugin]
    assert "midpoint" in call(*words, *settings(*TINY[:4], *small))
    (folder,) = (tmp_path / "r").glob("smoke-*")
    assert {"report.html", "results.json", "weights.safetensors", "metrics.jsonl"} <= {f.name for f in folder.iterdir()}


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [[], ["train.patience=1", "train.validate_every=1", "train.average={use: ema, decay: 0.5}", "train.clip_norm=0.1"]],
    ids=["plain", "early"],
)
def test_two_processes_train_the_weights_of_one(tmp_path, changes):
    small = ["data.shapes.count=8", "data.shapes.held_out=2", "train.epochs=2", "evaluate.metrics=[cd]", *changes]
    words = ["run", ROOT / "pcsr/recipes/smoke.yaml", "--device", "cpu", *settings(*TINY[:4], "train.batch=4", *small)]
    torchrun = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    trained = []
    for head, tail in (([], []), (torchrun, ["--devices", "2"])):
        runs = tmp_path / str(len(tail))
        call(*words, *tail, "--runs", runs, head=head)
        (path,) = runs.glob("smoke-*/weights.safetensors")
        trained.append(load_file(path))
    one, two = trained
    assert all(torch.allclose(one[name], two[name], atol=1e-4) for name in one)


@pytest.mark.slow
def test_a_recipe_runs_on_data_that_is_built_already(world, tmp_path):
    plugin = ("--plugin", world)
    made = settings("touch=caps", "points=64", "rate=4", "touches=2", "count=4", "held_out=2", "seed=5")
    call("data", "make", "balls", "-o", tmp_path / "data", *made, *plugin)
    before = {path: path.read_bytes() for path in (tmp_path / "data").iterdir()}
    small = settings(*TINY[1:4], "train.epochs=1", "train.batch=2", "train.touches=[0, 2]", "evaluate.metrics=[cd]")
    run = ("run", ROOT / "pcsr/recipes/smoke.yaml", "--runs", tmp_path / "runs", "--data", tmp_path / "data")
    assert "midpoint" in call(*run, *small, *plugin)
    (results,) = (tmp_path / "runs").glob("smoke-*/results.json")
    written = json.loads(results.read_text())
    manifest = json.loads((tmp_path / "data" / "manifest.json").read_text())
    assert written["data"]["fingerprint"] == manifest["fingerprint"]
    assert (written["data"]["shapes"], written["data"]["points"], written["recipe"]["data"]["seed"]) == ("balls", 64, 5)
    assert not (tmp_path / "runs" / "data").exists()
    assert {path: path.read_bytes() for path in (tmp_path / "data").iterdir()} == before


@pytest.mark.parametrize("jsonl", [True, False])
def test_what_loggers_write_stays_when_a_network_is_trained_again(recipe, split, tmp_path, jsonl):
    registry = load_plugins()
    registry.add(Entry("logger", "events", Events, "tests", "0"))
    loggers = (*([PartSpec(use="jsonl")] if jsonl else []), PartSpec(use="events"))
    one = recipe.model_copy(update={"train": recipe.train.model_copy(update={"loggers": loggers})})
    lengths = []
    for retrain in (False, True):
        options = RunOptions(runs=tmp_path, retrain=retrain)
        folder = run_folder(one, options)
        folder.mkdir(exist_ok=True)
        with Progress(disable=True) as progress:
            _, training = trained(one, registry, "data", lambda *_: split, fabric(), options, progress)
        lengths.append(len((folder / "events" / "steps.txt").read_text().splitlines()))
        names = {"events", "weights.safetensors", *(["metrics.jsonl"] if jsonl else [])}
        assert {path.name for path in folder.iterdir()} == {*names, "recipe.json", "environment.json"}
    assert lengths[0] == lengths[1] > 0
    assert (training["steps"], training["device"], training["validation"].keys()) == (6, "1 x cpu", {"cd"})
    assert packages(one, registry, RunOptions()).get("no_such_package") == "logger 'events'"


class UntrainedError(Exception):
    """Data was asked for: no finished weights were found."""


@pytest.fixture
def finished(recipe, registry, tmp_path):
    """Asks for a recipe's network where an earlier run of `recipe` has left its weights."""

    def leave(of, data="data", runs="runs"):
        network = build(of, registry)
        card = {
            "recipe": of.resolved(),
            "fingerprint": of.fingerprint,
            "data_fingerprint": data,
            "training": {"seconds": 7.0},
        }
        path = run_folder(of, RunOptions(runs=tmp_path / runs)) / "weights.safetensors"
        path.parent.mkdir(parents=True)
        save_weights(path, network, card)
        return network

    def ask(of, data="data"):
        def untrained(split, progress):
            raise UntrainedError

        with Progress(disable=True) as progress:
            return trained(of, registry, data, untrained, fabric(), RunOptions(runs=tmp_path / "runs"), progress)

    return leave, ask


@pytest.mark.parametrize("retrain", [False, True])
def test_snapshots_are_weights_files_of_the_run_folder(recipe, registry, split, tmp_path, retrain):
    recipe = recipe.model_copy(update={"train": recipe.train.model_copy(update={"snapshots": (1, 4)})})
    options = RunOptions(runs=tmp_path, retrain=retrain)
    folder = run_folder(recipe, options)
    folder.mkdir()
    with Progress(disable=True) as progress:
        last, _ = trained(recipe, registry, "data", lambda name, progress: split, fabric(), options, progress)
    names = {"weights-1.safetensors", "weights-4.safetensors", "weights.safetensors", "metrics.jsonl"}
    assert {path.name for path in folder.iterdir()} == {*names, "recipe.json", "environment.json"}
    found = {}
    for step in (1, 4):
        network, of, card = load_weights(folder / f"weights-{step}.safetensors", registry)
        assert (of.model, of.train) == (recipe.model, recipe.train)
        assert (card["training"]["steps"], card["data_fingerprint"]) == (step, "data")
        found[step] = weights(network)
    assert not torch.equal(found[1], found[4])
    assert not torch.equal(found[4], weights(last)), "six steps in all"


def test_the_same_training_is_not_done_again_under_another_name(recipe, finished):
    leave, ask = finished
    network = leave(recipe)
    assert recipe.touch_range == (0, 2), "a number of its own: that of the evaluation is free"
    data = recipe.data.model_copy(update={"touches": 1})
    for other in (recipe.model_copy(update={"name": "renamed"}), recipe.model_copy(update={"name": "x", "data": data})):
        found, source = ask(other)
        assert torch.equal(weights(found), weights(network))
        assert not found.training
        assert source.pop("weights") == tensors_hash(network.state_dict())
        assert source == {"seconds": 7.0, "source": "another run of this recipe"}
    assert ask(recipe)[1]["source"] == "this run folder"


def test_what_is_another_training_is_not_taken_for_this_one(recipe, finished):
    leave, ask = finished
    leave(recipe)
    other = recipe.model_copy(update={"name": "renamed", "seed": recipe.seed + 1})
    with pytest.raises(UntrainedError):
        ask(other)
    with pytest.raises(UntrainedError):
        ask(recipe.model_copy(update={"name": "renamed"}), data="other data")


def test_a_folder_whose_name_merely_ends_alike_is_not_believed(recipe, finished, tmp_path):
    leave, ask = finished
    other = recipe.model_copy(update={"seed": recipe.seed + 1})
    leave(other)
    (folder,) = (tmp_path / "runs").iterdir()
    folder.rename(folder.with_name(f"{recipe.name}-{recipe.fingerprint[:8]}"))
    with pytest.raises(UntrainedError):
        ask(recipe.model_copy(update={"name": "renamed"}))


def test_other_runs_than_those_of_this_place_are_not_looked_through(recipe, finished):
    leave, ask = finished
    leave(recipe, runs="elsewhere")
    with pytest.raises(UntrainedError):
        ask(recipe.model_copy(update={"name": "renamed"}))


@pytest.mark.parametrize(
    ("settings", "built", "needed"),
    [
        (["evaluate.metrics=[cd]"], False, {"manifold3d", "embreex"}),
        (["evaluate.metrics=[cd]"], True, set()),
        (["evaluate.metrics=[cd, p2f]"], True, {"manifold3d"}),
        (["evaluate.metrics=[cd]", "evaluate.baselines=[floor]"], True, {"manifold3d"}),
        (["evaluate.metrics=[cd, emd]"], True, set()),  # 256 points: scipy's
        (["evaluate.metrics=[cd, emd]", "data.points=512"], True, {"ot"}),
        (["evaluate.metrics=[cd]", "train.objective=pu-net"], True, {"ot"}),
        (["evaluate.metrics=[cd]", "train.objective=pu-net", "weights=tapsr"], True, set()),
        (["evaluate.metrics=[cd]", "data.touches=0", "train.touches=0"], False, {"manifold3d"}),
        (["evaluate.metrics=[cd]", "data.touches=0", "train.touches=[0, 2]"], False, {"manifold3d", "embreex"}),
        (
            ["evaluate.metrics=[cd]", "data.touches=0", "train.touches=0", "data.sampling=view"],
            False,
            {"manifold3d", "embreex"},
        ),
    ],
)
def test_a_run_needs_the_packages_that_it_will_use(recipe, registry, settings, built, needed):
    plain = [one for one in settings if not one.startswith("weights")]
    one = load(ROOT / "pcsr/recipes/smoke.yaml", registry, [*TINY, *plain])[0]
    if plain != settings:
        one = one.model_copy(update={"weights": Weights(use="tapsr", sha256="0" * 64)})
    options = RunOptions(data=(Path("data"),) if built else ())
    assert packages(one, registry, options).keys() == needed | {"lightning_fabric", "plotly"}
