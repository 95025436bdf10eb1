"""The files that training writes to a run folder: a history, and a checkpoint from which it can be resumed."""

import math
import time
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import nn

from pcsr.data.dataset import Split
from pcsr.errors import RunError
from pcsr.experiments.history import History
from pcsr.experiments.train_state import load_training, save_training
from pcsr.metrics.chamfer import chamfer
from pcsr.network.network import Network
from pcsr.recipe import Recipe
from pcsr.run_files import CHECKPOINT, HISTORY
from pcsr.threads import thread_count, threads
from pcsr.upsample import points_at_once, upsample_plainly
from pcsr.weights.file import read_file

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
    """Writes the history, the validation errors and the checkpoints of a training run.

    With several processes each has a recorder, and only the first one writes.
    """

    def __init__(
        self,
        recipe: Recipe,
        network: Network,
        validation: Split,
        run: Path,
        *,
        per_epoch: int,
        data_fingerprint: str | None,
        writes: bool,
    ) -> None:
        """Create a recorder.

        Args:
            recipe: of the network.
            network: is measured ten times in a run.
            validation: objects on which it is measured; at most `WATCHED` of them are.
            run: folder of the files.
            per_epoch: steps in an epoch.
            data_fingerprint: of the training data. None: a checkpoint of any data is resumed.
            writes: whether this process is the first one.
        """
        self.recipe, self.network = recipe, network
        self.watched = validation.spread(min(WATCHED, len(validation)))
        self.checkpoint, self.history = run / CHECKPOINT, History(run / HISTORY)
        self.per_epoch, self.steps = per_epoch, recipe.train.epochs * per_epoch
        self.every = max(1, recipe.train.epochs // 10) * per_epoch
        self.data_fingerprint, self.writes = data_fingerprint, writes
        self.step, self.threads = 0, 0
        self.seconds_before = 0.0

    def resume(self, model: nn.Module, optimizer: torch.optim.Optimizer, threads: int) -> int:
        """Load the checkpoint, if there is one of the same data, and remove later steps from the history.

        Returns:
            The number of threads that the checkpoint was computed with, or `threads` without one. Another number
            rounds sums differently.
        """
        if self.checkpoint.exists() and _is_of(self.checkpoint, self.data_fingerprint):
            about = load_training(self.checkpoint, model, optimizer)
            self.step, self.seconds_before = about["step"], about["seconds"]
            threads = about.get("threads", threads)
        self.history.cut(self.step)
        return threads

    def start(self, model: nn.Module, optimizer: torch.optim.Optimizer, threads: int) -> None:
        """Start the clock. `model` and `optimizer` are what checkpoints contain."""
        self.model, self.optimizer, self.threads = model, optimizer, threads
        self.started = self.saved = time.monotonic()

    def add(self, losses: dict[str, float], lr: float) -> Progress:
        """Record a step, and measure the network where validation is due.

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
        seconds = time.monotonic() - self.started
        if self.writes:
            epoch = self.step // self.per_epoch
            line = {"step": self.step, "epoch": epoch, "loss": total, "losses": losses, "rate": lr}
            spent = round(self.seconds_before + seconds, 2)
            self.history.add({**line, "seconds": spent, "threads": self.threads})
            if self.step % self.every == 0 or self.step == self.steps:
                error = validate(self.network, self.watched, self.recipe)
                self.history.add({"epoch": epoch, "step": self.step, "validation": {"cd": error}})
        return Progress(self.step, self.steps, total, seconds)

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
                "data_fingerprint": self.data_fingerprint,
            }
            save_training(self.checkpoint, self.model, self.optimizer, about)
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
def validate(network: Network, split: Split, recipe: Recipe) -> float:
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
