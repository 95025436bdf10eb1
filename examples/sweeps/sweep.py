"""Search for settings of a recipe, at random or with Optuna.

Each trial is one `pcsr run`. Its error is that of the validation objects, so that the test objects stay unseen. The
same command goes on after an interruption: trained trials are found again by their settings.

    python sweep.py smoke --trials 20
    python sweep.py smoke --trials 20 --optuna
"""

import argparse
import hashlib
import json
import math
import random
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

LITTLE = ("evaluate.metrics=[cd]", "evaluate.objects=1", "evaluate.examples=0")
"""A trial is not evaluated: these settings make the evaluation short, and do not belong to the fingerprint."""

DIVERGED = 1
"""Exit status of `pcsr run` where a run cannot finish though its recipe is good: a loss that is not finite."""


def suggest(trial: Any) -> dict[str, Any]:
    """Choose the settings of a trial: the space that is searched. Change it."""
    return {
        "train.learning_rate": trial.suggest_float("learning_rate", 1e-4, 1e-2, log=True),
        "train.schedule": trial.suggest_categorical("schedule", ["steps", "cosine"]),
        "train.clip_norm": trial.suggest_categorical("clip_norm", [None, 1.0]),
    }


class RandomTrial:
    """A trial with random settings, by the methods of a trial of Optuna."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)

    def suggest_float(self, _name: str, low: float, high: float, *, log: bool = False) -> float:
        return low * (high / low) ** self.random.random() if log else self.random.uniform(low, high)

    def suggest_int(self, _name: str, low: int, high: int) -> int:
        return self.random.randint(low, high)

    def suggest_categorical(self, _name: str, choices: Sequence[Any]) -> Any:
        return self.random.choice(choices)


def options(settings: dict[str, Any]) -> list[str]:
    """The settings as options of `pcsr run`. JSON is YAML."""
    return [word for key, value in settings.items() for word in ("--set", f"{key}={json.dumps(value)}")]


def validation_error(recipe: str, settings: dict[str, Any], runs: Path, fixed: Sequence[str] = ()) -> float:
    """Train a recipe with these settings, and return its validation error; infinity where the training diverges."""
    name = "sweep-" + hashlib.sha256(json.dumps([recipe, settings, *fixed]).encode()).hexdigest()[:12]
    words = [*fixed, *LITTLE, f"name={name}"]
    command = [sys.executable, "-m", "pcsr.cli", "run", recipe, "--runs", str(runs), *options(settings)]
    command += [word for one in words for word in ("--set", one)]
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    error = math.inf
    if done.returncode != DIVERGED:
        if done.returncode:
            sys.stderr.write(done.stderr)
        done.check_returncode()
        (results,) = runs.glob(f"{name}-*/results.json")
        error = float(json.loads(results.read_text(encoding="utf-8"))["training"]["validation"]["cd"])
    print(described(settings, error), flush=True)  # noqa: T201
    return error


def described(settings: dict[str, Any], error: float) -> str:
    """The validation error and the settings as a line."""
    listed = ", ".join(f"{key.rpartition('.')[2]} {value}" for key, value in settings.items())
    return f"validation cd ×10³ {1000 * error:.4g}: {listed}"


def search_at_random(error: Callable[[dict[str, Any]], float], trials: int, seed: int) -> dict[str, Any]:
    """Return the best of some random settings."""
    return min((suggest(RandomTrial(seed + number)) for number in range(trials)), key=error)


def search_with_optuna(error: Callable[[dict[str, Any]], float], trials: int, seed: int) -> dict[str, Any]:
    """Return the best settings that Optuna finds."""
    import optuna

    study = optuna.create_study(direction="minimize", sampler=optuna.samplers.TPESampler(seed=seed))
    study.optimize(lambda trial: error(suggest(trial)), n_trials=trials)
    return suggest(study.best_trial)  # its suggestions are those of the trial


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recipe", help="a recipe of pcsr, or a file")
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--runs", type=Path, default=Path("runs"))
    parser.add_argument("--set", action="append", default=[], help="a setting of all trials, such as train.epochs=5")
    parser.add_argument("--optuna", action="store_true", help="search with Optuna (pip install optuna)")
    given = parser.parse_args(arguments)
    search = search_with_optuna if given.optuna else search_at_random
    errors: dict[str, float] = {}

    def error(settings: dict[str, Any]) -> float:
        found = validation_error(given.recipe, settings, given.runs, given.set)
        return errors.setdefault(json.dumps(settings), found)

    best = search(error, given.trials, given.seed)
    fixed = [word for one in given.set for word in ("--set", one)]
    words = ["pcsr", "run", given.recipe, "--runs", str(given.runs), *fixed, *options(best)]
    print(f"the best: {described(best, errors[json.dumps(best)])}")  # noqa: T201
    print(*(f"'{word}'" if set(word) & set(' []{}"') else word for word in words))  # noqa: T201


if __name__ == "__main__":
    main()
