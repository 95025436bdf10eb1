"""Training: its steps, its history, and that a stop leaves no trace."""

import json
import os
import shutil
import signal
from pathlib import Path

import numpy as np
import pytest
import torch
from lightning_fabric import Fabric
from safetensors.torch import load_file

from pcsr import Objective
from pcsr.data.batches import Batches
from pcsr.data.dataset import Split
from pcsr.data.loading import prepared
from pcsr.errors import RunError, UserError
from pcsr.experiments.recorder import CHECKPOINT, HISTORY, Progress, validate
from pcsr.experiments.train import learning_rate, train
from pcsr.geometry.frames import UnitSphere
from pcsr.network.network import Network
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Entry
from pcsr.recipe import Recipe, load

SMOKE = Path(__file__).parents[2] / "recipes" / "smoke.yaml"
TINY = f"""\
extends: {SMOKE.as_posix()}
name: tiny
data: {{touches: 1, points: 24, touch: {{points: 16}}}}
model:
  encoder: {{channels: 8}}
  touch_encoder: {{channels: 4}}
  backbone: {{channels: [8], neighbours: 4}}
  upsampler: {{hidden: 8, start: point}}
train: {{epochs: 4, batch: 3, touches: [0, 2]}}
"""
STEPS = 8
"""Four epochs of two batches."""


@pytest.fixture
def recipe(tmp_path) -> Recipe:
    path = tmp_path / "tiny.yaml"
    path.write_text(TINY)
    (only,) = load(path, load_plugins())
    return only


def split(count: int, seed: int) -> Split:
    random = torch.Generator().manual_seed(seed)
    truth = torch.randn(count, 96, 3, generator=random)
    truth = truth / truth.norm(dim=-1, keepdim=True)
    return Split(
        names=[f"object {i}" for i in range(count)],
        groups=["all"] * count,
        truth=list(truth),
        points=list(truth[:, ::4].clone()),
        touches=list(truth[:, :32].reshape(count, 2, 16, 3).clone()),
        spheres=[UnitSphere(np.zeros(3), 1.0)] * count,
        felt=[(0.1, 0.2)] * count,
        about={},
    )


def trained(recipe: Recipe, run: Path, **options) -> Network:
    run.mkdir(exist_ok=True)
    fabric = Fabric(accelerator="cpu", devices=1)
    return train(recipe, options.pop("registry", load_plugins()), split(6, 1), split(2, 2), run, fabric, **options)


def history(run: Path) -> list[dict]:
    """The history without its times, which differ from run to run."""
    lines = [json.loads(line) for line in (run / HISTORY).read_text().splitlines()]
    return [{key: value for key, value in line.items() if key != "seconds"} for line in lines]


def stop_at(step: int):
    def shown(progress: Progress) -> None:
        if progress.step == step:
            raise KeyboardInterrupt

    return shown


def signal_at(step: int, number: signal.Signals):
    def shown(progress: Progress) -> None:
        assert progress.step <= step, "training went on after the signal"
        if progress.step == step:
            os.kill(os.getpid(), number)

    return shown


def same(a: Network, b: Network) -> bool:
    return all(torch.equal(x, y) for x, y in zip(a.parameters(), b.parameters(), strict=True))


@pytest.mark.parametrize("optimizer", ["adam", "adamw"])
def test_stopped_and_resumed_is_bit_for_bit_as_never_stopped(recipe, tmp_path, optimizer):
    recipe = recipe.model_copy(update={"train": recipe.train.model_copy(update={"optimizer": optimizer})})
    whole = trained(recipe, tmp_path / "whole")
    run = tmp_path / "stopped"
    for step in (3, 6):  # killed between a step and its checkpoint, twice
        with pytest.raises(KeyboardInterrupt):
            trained(recipe, run, shown=stop_at(step), checkpoint_every=0.0)
    steps = []
    resumed = trained(recipe, run, shown=lambda progress: steps.append(progress.step))
    assert steps == [6, 7, 8]  # the checkpoint is that of step 5
    assert same(whole, resumed)
    assert history(run) == history(tmp_path / "whole")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_the_step_and_writes_its_checkpoint(recipe, tmp_path, number):
    whole = trained(recipe, tmp_path / "whole")
    before = signal.getsignal(number)
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "stopped", shown=signal_at(3, number))
    assert signal.getsignal(number) is before
    steps = []
    resumed = trained(recipe, tmp_path / "stopped", shown=lambda progress: steps.append(progress.step))
    assert steps == [4, 5, 6, 7, 8]
    assert same(whole, resumed)


@pytest.fixture
def two_threads():
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    yield
    torch.set_num_threads(before)


def threads_of_steps(run: Path) -> set[int]:
    return {line["threads"] for line in history(run) if "loss" in line}


def test_small_batches_are_trained_on_one_thread_and_give_the_others_back(two_threads, recipe, tmp_path):
    several = trained(recipe, tmp_path / "run")
    assert torch.get_num_threads() == 2
    assert threads_of_steps(tmp_path / "run") == {1}
    torch.set_num_threads(1)
    assert same(several, trained(recipe, tmp_path / "single"))


def test_a_training_goes_on_with_the_threads_that_it_began_with(two_threads, recipe, tmp_path, monkeypatch):
    monkeypatch.setattr("pcsr.threads.EACH", 1)
    whole = trained(recipe, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "stopped", shown=stop_at(5), checkpoint_every=0.0)
    torch.set_num_threads(3)  # a machine with more cores
    resumed = trained(recipe, tmp_path / "stopped")
    assert torch.get_num_threads() == 3
    assert same(whole, resumed)
    assert history(tmp_path / "stopped") == history(tmp_path / "whole")
    assert threads_of_steps(tmp_path / "stopped") == {2}


def test_a_training_goes_on_with_fewer_threads_where_there_are_no_more(two_threads, recipe, tmp_path, monkeypatch):
    monkeypatch.setattr("pcsr.threads.EACH", 1)
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "run", shown=stop_at(5), checkpoint_every=0.0)
    torch.set_num_threads(1)
    trained(recipe, tmp_path / "run")
    assert [line["threads"] for line in history(tmp_path / "run") if "loss" in line] == [2, 2, 2, 2, 1, 1, 1, 1]


def test_without_a_checkpoint_it_begins_anew_and_so_does_the_history(recipe, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "run", shown=stop_at(2))
    assert not (tmp_path / "run" / CHECKPOINT).exists()
    again = trained(recipe, tmp_path / "run")
    assert same(again, trained(recipe, tmp_path / "whole"))
    assert history(tmp_path / "run") == history(tmp_path / "whole")


def test_a_torn_last_line_of_the_history_is_dropped(recipe, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "run", shown=stop_at(4), checkpoint_every=0.0)
    with (tmp_path / "run" / HISTORY).open("a") as file:
        file.write('{"step": 4, "lo')
    trained(recipe, tmp_path / "run")
    trained(recipe, tmp_path / "whole")
    assert history(tmp_path / "run") == history(tmp_path / "whole")


def test_a_finished_training_is_not_trained_again(recipe, tmp_path):
    first = trained(recipe, tmp_path / "run")
    before = (tmp_path / "run" / HISTORY).read_bytes()
    steps = []
    assert same(first, trained(recipe, tmp_path / "run", shown=lambda progress: steps.append(progress.step)))
    assert steps == []
    assert (tmp_path / "run" / HISTORY).read_bytes() == before


def test_a_checkpoint_of_other_data_is_not_gone_on_from(recipe, tmp_path):
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "run", shown=stop_at(4), checkpoint_every=0.0, data_fingerprint="one")
    steps = {"one": [], "other": []}
    for data, taken in steps.items():
        shutil.copytree(tmp_path / "run", tmp_path / data)
        trained(recipe, tmp_path / data, shown=lambda p, t=taken: t.append(p.step), data_fingerprint=data)
    assert steps["one"] == list(range(4, STEPS + 1)), "as saved before the step that was stopped"
    assert steps["other"] == list(range(1, STEPS + 1))


def test_the_history_has_each_step_once_and_ten_validations_at_most(recipe, tmp_path):
    network = trained(recipe, tmp_path / "run")
    assert not network.training
    lines = history(tmp_path / "run")
    losses, validations = ([line for line in lines if key in line] for key in ("loss", "validation"))
    assert [line["step"] for line in losses] == list(range(1, STEPS + 1))
    assert [line["rate"] for line in losses] == [learning_rate(recipe, i // 2) for i in range(STEPS)]
    assert [line["step"] for line in validations] == [2, 4, 6, 8]
    assert validations[-1]["validation"]["cd"] == validate(network.eval(), split(2, 2), recipe)


def test_training_lowers_the_loss(recipe, tmp_path):
    longer = recipe.model_copy(update={"train": recipe.train.model_copy(update={"epochs": 15, "decay": 1.0})})
    trained(longer, tmp_path / "run")
    values = [line["validation"]["cd"] for line in history(tmp_path / "run") if "validation" in line]
    assert values[-1] < 0.9 * values[0]


@pytest.mark.parametrize(
    ("epochs", "decay_every", "epoch", "falls"),
    [(300, None, 29, 0), (300, None, 30, 1), (300, None, 299, 9), (5, None, 3, 3), (300, 50, 149, 2)],
)
def test_the_learning_rate_falls_in_steps(recipe, epochs, decay_every, epoch, falls):
    settings = recipe.train.model_copy(update={"epochs": epochs, "decay_every": decay_every})
    recipe = recipe.model_copy(update={"train": settings})
    assert learning_rate(recipe, epoch) == pytest.approx(1e-3 * 0.7**falls)


class Infinite(Objective):
    """Not finite from the third step on."""

    def __init__(self) -> None:
        super().__init__()
        self.calls = 0

    def forward(self, prediction, target):
        self.calls += 1
        return {"broken": prediction.sum() * (float("nan") if self.calls > 2 else 1)}


def test_a_loss_that_is_not_finite_ends_it_and_the_checkpoint_before_stays(recipe, tmp_path):
    registry = load_plugins()
    registry.add(Entry("objective", "infinite", Infinite, "test", "0"))
    objective = recipe.train.objective.model_copy(update={"use": "infinite", "options": {}})
    broken = recipe.model_copy(update={"train": recipe.train.model_copy(update={"objective": objective})})
    with pytest.raises(RunError, match=r"the loss is nan at step 3 of 8 .*lower train\.learning_rate"):
        trained(broken, tmp_path / "run", registry=registry, checkpoint_every=0.0)
    assert [line["step"] for line in history(tmp_path / "run") if "loss" in line] == [1, 2]
    steps = []
    trained(recipe, tmp_path / "run", shown=lambda progress: steps.append(progress.step))
    assert steps[0] == 3


def test_a_batch_that_processes_cannot_share_is_refused(recipe, tmp_path):
    class Two(Fabric):
        world_size = 2

    with pytest.raises(UserError, match=r"train\.batch is 3, which 2 processes cannot share equally"):
        train(recipe, load_plugins(), split(6, 1), split(2, 2), tmp_path, Two(accelerator="cpu", devices=1))


class Judge(Objective):
    """Judges the stages, and owns a weight that learns at a tenth of the pace."""

    lr_multiplier = 0.1

    def __init__(self) -> None:
        super().__init__()
        self.own = torch.nn.Parameter(torch.ones(()))
        self.drawn = torch.nn.Parameter(torch.rand(()), requires_grad=False)

    def forward(self, prediction, target):
        return {"off": (prediction.mean(1) - target.mean(1)).square().sum() + self.own}

    def losses(self, network, points, truth, rate, touches=None):
        stages = network.stages(points, rate, touches)
        return {"stages": torch.tensor(float(len(stages))), **self(stages[-1], truth)}


def test_an_objective_may_judge_more_than_the_result_and_learn_at_its_own_pace(recipe, tmp_path):
    registry = load_plugins()
    registry.add(Entry("objective", "judge", Judge, "tests", "0"))
    spec = recipe.train.objective.model_copy(update={"use": "judge", "options": {}})
    recipe = recipe.model_copy(update={"train": recipe.train.model_copy(update={"objective": spec, "decay": 1.0})})
    trained(recipe, tmp_path / "run", registry=registry)
    torch.rand(3)  # whatever the process drew before, its weights are those of the recipe's seed
    trained(recipe, tmp_path / "again", registry=registry)
    assert torch.equal(*(load_file(tmp_path / run / CHECKPOINT)["model.objective.drawn"] for run in ("run", "again")))
    assert all(line["losses"]["stages"] == 1 for line in history(tmp_path / "run") if "losses" in line)
    own = load_file(tmp_path / "run" / CHECKPOINT)
    weight = own["model.objective.own"]
    # The gradient is always 1, so that each step of Adam is as long as its rate.
    assert float(weight) == pytest.approx(1 - STEPS * recipe.train.learning_rate * Judge.lr_multiplier, rel=1e-4)


def test_training_in_patches_stops_and_resumes_alike(tmp_path):
    path = tmp_path / "patches.yaml"
    path.write_text(TINY + "patches: {points: 16, rate: 2}\n")
    (recipe,) = load(path, load_plugins(), ["data.rate=4"])
    whole = trained(recipe, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "run", shown=stop_at(4), checkpoint_every=0.0)
    assert same(whole, trained(recipe, tmp_path / "run"))
    assert whole.upsampler.rate == 2


def test_beside_a_cpu_that_trains_no_process_makes_batches(recipe, tmp_path, monkeypatch):
    asked = []

    def spy(batches, steps, loaders, *share):
        asked.append(loaders)
        return prepared(batches, steps, loaders, *share)

    monkeypatch.setattr("pcsr.experiments.train.prepared", spy)
    trained(recipe, tmp_path / "run", loaders=3)
    assert asked == [0]


@pytest.mark.parametrize(("sampling", "redrawn"), [("random", True), ("mixed", True), ("fps", False), ("view", False)])
def test_clouds_are_drawn_anew_where_that_is_what_they_are(recipe, tmp_path, monkeypatch, sampling, redrawn):
    seen = []

    class Seen(Batches):
        def at(self, step, rank=0, ranks=1):
            seen.append(self.augment)
            return super().at(step, rank, ranks)

    monkeypatch.setattr("pcsr.experiments.train.Batches", Seen)
    data = recipe.data.model_copy(update={"sampling": sampling})
    trained(recipe.model_copy(update={"data": data}), tmp_path / "run")
    assert {"redraw" in augment for augment in seen} == {redrawn}


@pytest.mark.parametrize("upsampler", ["shuffle", "{use: edge-offsets, hidden: 8}"])
def test_training_with_anchors_stops_and_resumes_alike(tmp_path, upsampler):
    path = tmp_path / "edge-conv.yaml"
    path.write_text(TINY)
    changes = [
        "model.fusion={use: edge-conv, hidden: 8}",
        f"model.upsampler={upsampler}",
        "train.augment=[redraw, crop]",
    ]
    (recipe,) = load(path, load_plugins(), changes)
    whole = trained(recipe, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "run", shown=stop_at(4), checkpoint_every=0.0)
    assert same(whole, trained(recipe, tmp_path / "run"))
    assert whole.fusion.out.weight.abs().max() > 0, "nothing was learned of the touches"
