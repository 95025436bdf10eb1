"""Training: its steps, its history, its objective."""

import pytest
import torch
from lightning_fabric import Fabric
from safetensors.torch import load_file

from pcsr import Objective
from pcsr.data.batches import Batches
from pcsr.data.loading import prepared
from pcsr.errors import RunError, UserError
from pcsr.experiments.optimization import learning_rate
from pcsr.experiments.recorder import CHECKPOINT, validate
from pcsr.experiments.train import train
from pcsr.network.build import build
from pcsr.plugins.loading import load_plugins
from pcsr.plugins.registry import Entry
from pcsr.recipe import Recipe
from tests.small_training import STEPS, history, same, split, threads_of_steps, tiny, trained


@pytest.fixture
def recipe(tmp_path) -> Recipe:
    return tiny(tmp_path)


def test_small_batches_are_trained_on_one_thread_and_give_the_others_back(two_threads, recipe, tmp_path):
    several = trained(recipe, tmp_path / "run")
    assert torch.get_num_threads() == 2
    assert threads_of_steps(tmp_path / "run") == {1}
    torch.set_num_threads(1)
    assert same(several, trained(recipe, tmp_path / "single"))


def test_the_history_has_each_step_once_and_ten_validations_at_most(recipe, tmp_path):
    network = trained(recipe, tmp_path / "run")
    assert not network.training
    lines = history(tmp_path / "run")
    losses, validations = ([line for line in lines if key in line] for key in ("loss", "validation"))
    assert [line["step"] for line in losses] == list(range(1, STEPS + 1))
    assert [line["rate"] for line in losses] == [learning_rate(recipe.train, i, 2) for i in range(STEPS)]
    assert [line["step"] for line in validations] == [2, 4, 6, 8]
    assert validations[-1]["validation"]["cd"] == validate(network.eval(), split(2, 2), recipe)


def test_training_lowers_the_loss(recipe, tmp_path):
    longer = recipe.model_copy(update={"train": recipe.train.model_copy(update={"epochs": 15, "decay": 1.0})})
    trained(longer, tmp_path / "run")
    values = [line["validation"]["cd"] for line in history(tmp_path / "run") if "validation" in line]
    assert values[-1] < 0.9 * values[0]


def plain(recipe: Recipe) -> torch.nn.Module:
    """The training of the paper, written out: Adam, and a learning rate that decays in steps."""
    registry = load_plugins()
    network, objective = build(recipe, registry), recipe.train.objective.build(registry, "objective")
    batches = Batches(split(6, 1), recipe.train.batch, recipe.touch_range, recipe.train.augment, recipe.seed)
    optimizer = torch.optim.Adam(network.parameters(), lr=1e-3)
    for step in range(STEPS):
        optimizer.param_groups[0]["lr"] = 1e-3 * 0.7 ** (step // 2)
        batch = batches.at(step)
        losses = objective.losses(network, batch.points, batch.truth, recipe.data.rate, batch.touches)
        optimizer.zero_grad()
        sum(losses.values()).backward()
        optimizer.step()
    return network


def test_by_default_training_is_plain_to_the_last_bit(recipe, tmp_path):
    assert same(trained(recipe, tmp_path / "run"), plain(recipe))


def test_gradients_of_a_long_norm_are_scaled_to_the_limit_and_their_norm_is_logged(tmp_path):
    sgd = ("train.optimizer=sgd", "train.decay=1.0", "train.learning_rate=0.1", "train.snapshots=[1]")
    recipe = tiny(tmp_path, *sgd, "train.clip_norm=0.01")
    start = torch.cat([p.detach().flatten().clone() for p in build(recipe, load_plugins()).parameters()])
    ends = {}

    def keep(network, step, training):
        ends[step] = torch.cat([p.detach().flatten().clone() for p in network.parameters()])

    trained(recipe, tmp_path / "run", kept=keep)
    norms = [line["gradient_norm"] for line in history(tmp_path / "run") if "loss" in line]
    assert min(norms) > 0.01
    assert float((ends[1] - start).norm()) == pytest.approx(0.1 * 0.01, rel=1e-3)


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


def test_after_the_steps_of_snapshots_the_network_is_handed_over(tmp_path):
    recipe = tiny(tmp_path, "train.snapshots=[2, 3, 8]")
    kept = {}

    def keep(network, step, training):
        assert (training["steps"], training["validation"].keys()) == (step, {"cd"} if step > 1 else set())
        kept[step] = {name: tensor.clone() for name, tensor in network.state_dict().items()}

    last = trained(recipe, tmp_path / "run", kept=keep)
    assert list(kept) == [2, 3, 8]
    assert all(torch.equal(tensor, last.state_dict()[name]) for name, tensor in kept[8].items())
    assert not all(torch.equal(tensor, kept[3][name]) for name, tensor in kept[2].items())
    assert same(last, trained(tiny(tmp_path), tmp_path / "without")), "keeping them changes nothing"


def test_a_snapshot_after_the_end_is_refused(tmp_path):
    with pytest.raises(
        UserError,
        match=r"train\.snapshots names step 9, and training ends after 8 steps \(4 epochs of 2\): raise train\.epochs",
    ):
        trained(tiny(tmp_path, "train.snapshots=[2, 9]"), tmp_path / "run")


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
