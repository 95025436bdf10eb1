"""A training that is stopped goes on as if it never had been."""

import os
import shutil
import signal

import pytest
import torch

from pcsr.experiments.recorder import CHECKPOINT, Progress, validate
from pcsr.recipe import Recipe
from pcsr.recipe.optimizers import OPTIMIZERS
from pcsr.run_files import HISTORY
from tests.small_training import STEPS, history, same, split, stop_at, threads_of_steps, tiny, trained


@pytest.fixture
def recipe(tmp_path) -> Recipe:
    return tiny(tmp_path)


def signal_at(step: int, number: signal.Signals):
    def shown(progress: Progress) -> None:
        assert progress.step <= step, "training went on after the signal"
        if progress.step == step:
            os.kill(os.getpid(), number)

    return shown


@pytest.mark.parametrize(
    "changes",
    [
        *(
            pytest.param([f"train.optimizer={name}"], marks=() if name in ("adam", "sgd") else [pytest.mark.slow])
            for name in OPTIMIZERS
        ),
        ["train.optimizer={use: sgd, momentum: 0.9, nesterov: true}"],
        ["train.optimizer={use: adam, amsgrad: true}"],
        ["train.schedule=cosine", "train.warmup=1.5"],
        ["train.schedule=linear", "train.clip_norm=0.1"],
        ["train.average={use: ema, decay: 0.6}"],
        ["train.average={use: swa, start: 1}"],
        ["train.average={use: swa, start: 3}"],
        ["train.patience=1", "train.average=ema", "train.validate_every=2"],
    ],
    ids=lambda changes: "-".join(changes).replace("train.", ""),
)
def test_stopped_and_resumed_is_bit_for_bit_as_never_stopped(tmp_path, changes):
    recipe = tiny(tmp_path, *changes)
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


@pytest.mark.slow
def test_a_training_goes_on_with_the_threads_that_it_began_with(two_threads, recipe, tmp_path, monkeypatch):
    monkeypatch.setattr("pcsr.threads.WORK_PER_THREAD", 1)
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
    monkeypatch.setattr("pcsr.threads.WORK_PER_THREAD", 1)
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


def test_training_in_patches_stops_and_resumes_alike(tmp_path):
    recipe = tiny(tmp_path, "data.rate=4", more="patches: {points: 16, rate: 2}\n")
    whole = trained(recipe, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "run", shown=stop_at(4), checkpoint_every=0.0)
    assert same(whole, trained(recipe, tmp_path / "run"))
    assert whole.upsampler.rate == 2


@pytest.mark.slow
@pytest.mark.parametrize("upsampler", ["shuffle", "{use: edge-offsets, hidden: 8}"])
def test_training_with_anchors_stops_and_resumes_alike(tmp_path, upsampler):
    changes = [
        "model.fusion={use: edge-conv, hidden: 8}",
        f"model.upsampler={upsampler}",
        "train.augment=[redraw, crop]",
    ]
    recipe = tiny(tmp_path, *changes)
    whole = trained(recipe, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "run", shown=stop_at(4), checkpoint_every=0.0)
    assert same(whole, trained(recipe, tmp_path / "run"))
    assert whole.fusion.out.weight.abs().max() > 0, "nothing was learned of the touches"


@pytest.fixture
def measured(monkeypatch):
    """Takes the place of validation: errors in their order."""

    def be(*errors):
        left = list(errors)
        monkeypatch.setattr("pcsr.experiments.recorder.validate", lambda *_: left.pop(0))

    return be


@pytest.mark.parametrize("average", ["null", "{use: ema, decay: 0.5}"])
def test_a_training_that_stops_early_keeps_the_best_weights_and_resumes_alike(tmp_path, measured, average):
    recipe = tiny(tmp_path, "train.patience=1", "train.snapshots=[4, 8]", f"train.average={average}")
    kept = {}

    def keep(network, step, training):
        kept[step] = {name: tensor.clone() for name, tensor in network.state_dict().items()}

    measured(0.3, 0.1, 0.2)
    steps = []
    whole = trained(recipe, tmp_path / "whole", kept=keep, shown=lambda progress: steps.append(progress.step))
    assert steps == [1, 2, 3, 4, 5, 6]
    assert kept.keys() == {4}
    assert all(torch.equal(tensor, kept[4][name]) for name, tensor in whole.state_dict().items())
    measured(0.3, 0.1, 0.2)
    with pytest.raises(KeyboardInterrupt):
        trained(recipe, tmp_path / "stopped", shown=stop_at(6), checkpoint_every=0.0)
    measured(0.2)
    assert same(whole, trained(recipe, tmp_path / "stopped"))
    assert history(tmp_path / "stopped") == history(tmp_path / "whole")
    measured()
    assert same(whole, trained(recipe, tmp_path / "stopped", shown=lambda progress: pytest.fail("it went on")))


def test_the_average_is_measured_and_kept_instead_of_the_last_weights(tmp_path):
    plain = trained(tiny(tmp_path), tmp_path / "plain")
    averaged = trained(tiny(tmp_path, "train.average={use: swa, start: 3}"), tmp_path / "swa")
    kept = []
    snapshots = tiny(tmp_path, "train.snapshots=[7, 8]")
    trained(
        snapshots,
        tmp_path / "steps",
        kept=lambda network, *_: kept.append(torch.cat([weight.detach().flatten() for weight in network.parameters()])),
    )
    mean = torch.cat([weight.detach().flatten() for weight in averaged.parameters()])
    torch.testing.assert_close(mean, (kept[0] + kept[1]) / 2)
    assert not same(plain, averaged)
    steps = [line["loss"] for line in history(tmp_path / "plain") if "loss" in line]
    assert [line["loss"] for line in history(tmp_path / "swa") if "loss" in line] == steps, "it trains the same"
    errors = [line["validation"]["cd"] for line in history(tmp_path / "swa") if "validation" in line]
    usual = [line["validation"]["cd"] for line in history(tmp_path / "plain") if "validation" in line]
    assert errors[:-1] == usual[:-1]
    assert errors[-1] == validate(averaged, split(2, 2), tiny(tmp_path)) != usual[-1]
