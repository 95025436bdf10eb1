"""examples/sweeps: a search at random and one by Optuna, or a stand-in where it is not installed."""

import importlib.util
import math
import re
import sys
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pytest

FILE = Path(__file__).parents[2] / "examples" / "sweeps" / "sweep.py"
SMALL = [
    "data.shapes.count=4", "data.shapes.held_out=2", "data.points=32", "data.touches=0", "train.touches=0",
    "train.batch=2", "train.epochs=1", "model.encoder.channels=8", "model.backbone.channels=[8]",
]  # fmt: skip


@pytest.fixture(scope="module")
def sweep():
    spec = importlib.util.spec_from_file_location("sweep", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def optuna(sweep, monkeypatch):
    """Optuna or, without it, a study that tries what is drawn at random."""
    if find_spec("optuna") is not None:
        return

    class Study:
        def optimize(self, objective, n_trials):
            best = min(range(n_trials), key=lambda seed: objective(sweep.RandomTrial(seed)))
            self.best_trial = sweep.RandomTrial(best)

    samplers = SimpleNamespace(TPESampler=lambda seed: None)
    stand_in = SimpleNamespace(create_study=lambda direction, sampler: Study(), samplers=samplers)
    monkeypatch.setitem(sys.modules, "optuna", stand_in)


@pytest.mark.parametrize("search", ["search_at_random", "search_with_optuna"])
@pytest.mark.filterwarnings("ignore")
@pytest.mark.usefixtures("optuna")
def test_a_search_tries_as_many_settings_as_it_is_asked_and_returns_the_best(sweep, search):
    tried = []

    def error(settings):
        tried.append(settings)
        return abs(math.log(settings["train.learning_rate"] / 1e-3)) if len(tried) > 1 else math.inf

    best = getattr(sweep, search)(error, 6, seed=3)
    assert len(tried) == 6
    assert all(1e-4 <= one["train.learning_rate"] <= 1e-2 for one in tried)
    assert best.keys() == sweep.suggest(sweep.RandomTrial(0)).keys()
    assert best == min(tried[1:], key=lambda one: abs(math.log(one["train.learning_rate"] / 1e-3)))


def test_random_settings_are_those_of_their_seed(sweep):
    assert (
        sweep.suggest(sweep.RandomTrial(1))
        == sweep.suggest(sweep.RandomTrial(1))
        != sweep.suggest(sweep.RandomTrial(2))
    )
    trial = sweep.RandomTrial(0)
    assert {trial.suggest_int("layers", 1, 3) for _ in range(50)} == {1, 2, 3}
    assert all(2 <= trial.suggest_float("weight", 2, 3) <= 3 for _ in range(50))


@pytest.mark.slow
def test_trials_are_runs_that_are_not_trained_twice(sweep, tmp_path, capfd):
    fixed = [word for one in SMALL for word in ("--set", one)]
    command = ["smoke", "--trials", "2", "--runs", str(tmp_path), *fixed]
    sweep.main(command)
    weights = {path: path.stat().st_mtime_ns for path in tmp_path.glob("sweep-*/weights.safetensors")}
    assert len(weights) == 2
    printed = capfd.readouterr().out
    sweep.main(command)
    assert {path: path.stat().st_mtime_ns for path in weights} == weights
    assert capfd.readouterr().out == printed
    *trials, best, command = printed.splitlines()
    assert len(trials) == 2
    number = r"validation cd ×10³ ([\d.]+): learning_rate 0\.00\d+, schedule \w+, clip_norm \S+"
    errors = [float(re.fullmatch(number, trial)[1]) for trial in trials]
    assert best == f"the best: {trials[errors.index(min(errors))]}"
    assert command.startswith(f"pcsr run smoke --runs {tmp_path} --set data.shapes.count=4 ")
    assert "--set train.learning_rate=0.00" in command


def test_a_training_that_diverges_is_the_worst_and_a_mistake_ends_the_search(sweep, tmp_path, monkeypatch, capsys):
    done = SimpleNamespace(returncode=1, stderr="a mistake", check_returncode=lambda: 1 / 0)
    monkeypatch.setattr(sweep.subprocess, "run", lambda *_, **__: done)
    assert sweep.validation_error("smoke", {}, tmp_path) == math.inf
    done.returncode = 2
    assert "validation cd ×10³ inf" in capsys.readouterr().out
    with pytest.raises(ZeroDivisionError):
        sweep.validation_error("smoke", {}, tmp_path)
    assert capsys.readouterr().err == "a mistake"
