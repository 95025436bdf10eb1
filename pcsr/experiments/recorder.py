"""What a training records: logged values, validation errors, averages, and checkpoints to resume from."""

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import torch
from torch import nn

from pcsr.data.dataset import Split
from pcsr.errors import RunError
from pcsr.experiments.early_stopping import EarlyStopping
from pcsr.experiments.history import LOSS, VALIDATION
from pcsr.experiments.loggers import Loggers
from pcsr.experiments.train_state import Stateful, load_training, save_training
from pcsr.experiments.weight_average import WeightAverage
from pcsr.metrics.chamfer import chamfer
from pcsr.network.kinds import AnyNetwork
from pcsr.recipe import Recipe
from pcsr.run_files import CHECKPOINT
from pcsr.threads import thread_count, threads
from pcsr.upsample import points_at_once, upsample_plainly
from pcsr.weights.file import read_file

if TYPE_CHECKING:
    from lightning_fabric import Fabric

WATCHED = 16
"""Number of validation objects that are measured during training."""


@dataclass(frozen=True)
class Progress:
    """The state of a training run after a step."""

    step: int
    """Number of steps done."""
    steps: int
    """Number of steps in total."""
    loss: float
    """Sum of the losses of this step."""
    seconds: float
    """Training time of this process; without the time before an interruption."""


class Recorder:
    """Logs the steps and the validation errors of a training run, and keeps its averages and checkpoints.

    With several processes each has a recorder, and only the first one writes.
    """

    def __init__(
        self,
        recipe: Recipe,
        network: AnyNetwork,
        validation: Split,
        run: Path,
        fabric: "Fabric",
        loggers: Loggers,
        *,
        per_epoch: int,
        data_fingerprint: str | None,
    ) -> None:
        """Create a recorder.

        Args:
            recipe: of the network.
            network: network that is trained.
            validation: objects on which it is measured; at most `WATCHED` of them are.
            run: folder of the files.
            fabric: launched; determines which process writes.
            loggers: loggers of the first process.
            per_epoch: steps in an epoch.
            data_fingerprint: of the training data. None: a checkpoint of any data is resumed.
        """
        train = recipe.train
        self.recipe, self.trained, self.run, self.loggers = recipe, network, run, loggers
        self.watched = validation.spread(min(WATCHED, len(validation)))
        self.checkpoint = run / CHECKPOINT
        self.per_epoch, self.steps = per_epoch, train.epochs * per_epoch
        self.every = (train.validate_every or max(1, train.epochs // 10)) * per_epoch
        self.data_fingerprint, self.fabric, self.writes = data_fingerprint, fabric, fabric.is_global_zero
        self.average = WeightAverage(network, train.average, train.epochs, per_epoch) if train.average else None
        self.stopping = EarlyStopping(train.patience) if train.patience else None
        states: dict[str, Stateful | None] = {"stopping": self.stopping}
        states["average"] = self.average.model if self.average else None
        self.others = {name: state for name, state in states.items() if state is not None}
        self.step, self.threads = 0, 0
        self.seconds = self.seconds_before = 0.0
        self.validation: dict[str, float] = {}

    def resume(self, model: nn.Module, optimizer: torch.optim.Optimizer, threads: int) -> int:
        """Load the checkpoint, if there is one of the same data.

        Returns:
            The number of threads that the checkpoint was computed with, or `threads` without one. Another number
            rounds sums differently.
        """
        if self.checkpoint.exists() and _is_of(self.checkpoint, self.data_fingerprint):
            about = load_training(self.checkpoint, model, optimizer, self.others)
            self.step, self.seconds, self.seconds_before = about["step"], about["seconds"], about["seconds"]
            self.validation = about.get("validation", {})
            threads = about.get("threads", threads)
        self.threads = threads
        return threads

    @contextmanager
    def running(self, model: nn.Module, optimizer: torch.optim.Optimizer, threads: int) -> Iterator[None]:
        """Start the clock and the loggers. `model` and `optimizer` are what checkpoints contain."""
        self.model, self.optimizer, self.threads = model, optimizer, threads
        if self.average is not None:
            self.average.model.to(self.fabric.device)
        self.started = self.saved = time.monotonic()
        with self.loggers.running(self.run, self.recipe, self.step):
            yield

    def add(self, losses: dict[str, float], values: dict[str, float]) -> Progress:
        """Record a step, and measure the network where validation is due.

        Args:
            losses: losses of the step by name.
            values: further values of the step to log.

        Raises:
            RunError: the loss is not finite.
        """
        self.step += 1
        total = sum(losses.values())
        if not math.isfinite(total):
            raise RunError(
                f"the loss is {total} at step {self.step} of {self.steps} ({losses}): lower train.learning_rate, or "
                f"look into the parts; the checkpoint before it is kept in {self.checkpoint}"
            )
        if self.average is not None:
            self.average.add(self.trained, self.step)
        seconds = time.monotonic() - self.started
        self.seconds = round(self.seconds_before + seconds, 2)
        epoch = self.step // self.per_epoch
        named = {f"{LOSS}{name}": loss for name, loss in losses.items()}
        clock = {"seconds": self.seconds, "threads": self.threads}
        self.loggers.log(self.step, {"epoch": epoch, "loss": total, **named, **values, **clock})
        if self.step % self.every == 0 or self.step == self.steps:
            self._validate(epoch)
        return Progress(self.step, self.steps, total, seconds)

    def _validate(self, epoch: int) -> None:
        """Measure the network in the first process."""
        error = validate(self.network, self.watched, self.recipe) if self.writes else 0.0
        self.loggers.log(self.step, {"epoch": epoch, f"{VALIDATION}cd": error})
        if self.stopping is not None:
            self.stopping.add(self.fabric.broadcast(error), self.step, self.network)
            error = self.stopping.lowest
        self.validation = {"cd": error}

    @property
    def network(self) -> AnyNetwork:
        """Network with the averaged weights, or the trained one where none are averaged yet."""
        averaged = self.average.network if self.average is not None else None
        return self.trained if averaged is None else cast(AnyNetwork, averaged)

    @property
    def stopped(self) -> bool:
        """Whether the training has ended before all of its epochs."""
        return self.stopping is not None and self.stopping.due

    def result(self) -> AnyNetwork:
        """Return the network with the weights that are kept, in `eval` mode."""
        if self.stopping is not None:
            self.stopping.restore(self.network)
        return self.network.eval()

    def summary(self) -> dict[str, Any]:
        """Return what results say of the training up to here: fields of `pcsr.results.Training`."""
        best = {"best_step": self.stopping.step} if self.stopping is not None else {}
        about = {
            "seconds": self.seconds,
            "steps": self.step,
            "epochs": self.step / self.per_epoch,
            "threads": self.threads,
            "validation": self.validation,
        }
        return {**about, **best, "device": f"{self.fabric.world_size} x {self.fabric.device.type}"}

    def save(self, every: float = 0.0) -> None:
        """Write a checkpoint, unless the last one is younger than `every` seconds."""
        now = time.monotonic()
        if every and now - self.saved <= every:
            return
        if self.writes:
            about = {
                "step": self.step,
                "seconds": self.seconds_before + now - self.started,
                "threads": self.threads,
                "validation": self.validation,
                "data_fingerprint": self.data_fingerprint,
            }
            save_training(self.checkpoint, self.model, self.optimizer, about, self.others)
        self.saved = time.monotonic()


def checkpoint_step(run: Path, data_fingerprint: str | None = None) -> int:
    """Return the step of the checkpoint in `run` from which training goes on; 0 without one of the same data."""
    checkpoint = run / CHECKPOINT
    if not checkpoint.exists() or not _is_of(checkpoint, data_fingerprint):
        return 0
    return int(read_file(checkpoint, tensors=False)[1]["step"])


def _is_of(checkpoint: Path, data_fingerprint: str | None) -> bool:
    """Whether a checkpoint belongs to these data. One without a fingerprint belongs to any."""
    of = read_file(checkpoint, tensors=False)[1].get("data_fingerprint")
    return of is None or data_fingerprint is None or of == data_fingerprint


@torch.no_grad()
def validate(network: AnyNetwork, split: Split, recipe: Recipe) -> float:
    """Compute the mean Chamfer distance over a split in the truth's unit sphere, with the touches of the recipe.

    The network works alone (`upsample_plainly`), so that the error is not that of the evaluation.
    """
    network.eval()
    values = []
    with threads(thread_count(points_at_once(recipe), network.parameter_count)):
        for i in range(len(split)):
            touches = list(split.touches[i][: recipe.data.touches].numpy())
            dense = upsample_plainly(recipe, network, split.points[i].numpy(), touches)
            values.append(float(chamfer(torch.from_numpy(dense)[None].float(), split.truth[i][None])))
    network.train()
    return sum(values) / len(values)
