"""Training: batches, objective, Adam, and a learning rate that decays in steps (TAPSR, Sec. 4.2.2).

Lightning Fabric runs it on one CPU as on several processes, nodes or GPUs, and in mixed precision.
"""

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import nn

from pcsr.contracts import Objective, TouchBatch
from pcsr.data.batches import Batch, Batches
from pcsr.data.dataset import Split
from pcsr.data.loading import LOADERS, prepared
from pcsr.errors import UserError
from pcsr.experiments.recorder import Progress, Recorder
from pcsr.files import sha256
from pcsr.network.build import build
from pcsr.network.network import Network
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe
from pcsr.recipe.schema import Weights
from pcsr.threads import thread_count, threads
from pcsr.weights.file import read_file
from pcsr.weights.find import find
from pcsr.weights.fit import fill_matching

if TYPE_CHECKING:
    from lightning_fabric import Fabric


class _Training(nn.Module):
    """Network and objective as one module, as a data-parallel wrapper needs them.

    Its arguments are tensors, since Fabric converts no other arguments to the precision of the run.
    """

    def __init__(self, network: Network, objective: Objective) -> None:
        super().__init__()
        self.network = network
        self.objective = objective

    def forward(
        self, points: torch.Tensor, truth: torch.Tensor, touches: torch.Tensor, mask: torch.Tensor, rate: int
    ) -> Any:
        return self.objective.losses(self.network, points, truth, rate, TouchBatch.of(touches, mask))


def train(
    recipe: Recipe,
    registry: Registry,
    data: Split,
    validation: Split,
    run: Path,
    fabric: "Fabric",
    *,
    shown: Callable[[Progress], None] = lambda progress: None,
    kept: Callable[[Network, int], object] = lambda network, step: None,
    checkpoint_every: float = 60.0,
    loaders: int = LOADERS,
    data_fingerprint: str | None = None,
) -> Network:
    """Train the network of a recipe, from the last checkpoint in `run` if there is one of the same data.

    Args:
        recipe: the resolved recipe.
        registry: of the parts.
        data: training split.
        validation: validation split; some of it is measured ten times during training.
        run: folder of the checkpoint and of `metrics.jsonl`.
        fabric: launched; determines device, number of processes and precision.
        shown: called after each step.
        kept: called with the network and the step after each step of `train.snapshots`, in the first process.
        checkpoint_every: seconds between checkpoints.
        loaders: number of processes that make batches for a GPU.
        data_fingerprint: of the data; a checkpoint of other data is ignored. None: a checkpoint of any data is resumed.

    Returns:
        The trained network in `eval` mode. The checkpoint stays in `run`.

    Raises:
        KeyboardInterrupt: the process was interrupted; a checkpoint of the last step is written first.
        RunError: the loss is not finite.
        UserError: the processes cannot share a batch equally, or training ends before a step of `train.snapshots`.
    """
    batches = _batches(recipe, data, fabric.world_size)
    model = _model(recipe, registry)
    optimizer = _optimizer(recipe, model)
    recorder = Recorder(
        recipe,
        model.network,
        validation,
        run,
        per_epoch=batches.per_epoch,
        data_fingerprint=data_fingerprint,
        writes=fabric.is_global_zero,
    )
    last = max(recipe.train.snapshots, default=0)
    if last > recorder.steps:
        raise UserError(
            f"train.snapshots names step {last}, and training ends after {recorder.steps} steps ({recipe.train.epochs} "
            f"epochs of {batches.per_epoch}): raise train.epochs, or leave the step out"
        )
    share = batches.size // fabric.world_size * recipe.network_points
    count = recorder.resume(model, optimizer, thread_count(share, model.network.parameter_count))
    wrapped, optimizer = fabric.setup(model, optimizer)
    with _stoppable() as stop, threads(count) as used:
        recorder.start(model, optimizer, used)
        ahead = 0 if fabric.device.type == "cpu" else loaders
        steps = range(recorder.step, recorder.steps)
        for batch in prepared(batches, steps, ahead, fabric.global_rank, fabric.world_size):
            lr = learning_rate(recipe, recorder.step // batches.per_epoch)
            losses = _step(wrapped, optimizer, fabric, batch, lr, recipe.network_rate)
            progress = recorder.add(losses, lr)
            if fabric.is_global_zero:
                shown(progress)
                if progress.step in recipe.train.snapshots:
                    kept(model.network, progress.step)
            if _any_process(stop.is_set(), fabric):
                recorder.save()
                raise KeyboardInterrupt
            recorder.save(checkpoint_every)
        recorder.save()
    return model.network.eval()


def _batches(recipe: Recipe, data: Split, processes: int) -> Batches:
    """Create the batches of a training run.

    Raises:
        UserError: the processes cannot share a batch equally.
    """
    settings = recipe.train
    if settings.batch % processes:
        raise UserError(
            f"train.batch is {settings.batch}, which {processes} processes cannot share equally: make it a multiple of "
            f"{processes}"
        )
    # A cloud that is redrawn from the truth is neither a view from one side nor evenly spaced.
    redrawn = recipe.data.sampling in ("random", "mixed")
    augment = [name for name in settings.augment if name != "redraw" or redrawn]
    size = min(settings.batch, len(data))
    return Batches(data, size, recipe.touch_range, augment, recipe.seed, recipe.patches)


def _model(recipe: Recipe, registry: Registry) -> _Training:
    """Build network and objective, with initial weights determined by the recipe's seed."""
    network = build(recipe, registry)
    if recipe.train.start is not None:
        fill_matching(network, *_start(recipe.train.start))
    with torch.random.fork_rng(devices=[]):  # an objective may have random initial weights
        torch.manual_seed(recipe.seed)
        return _Training(network, recipe.train.objective.build(registry, "objective"))


def _start(weights: Weights) -> tuple[dict[str, torch.Tensor], Path]:
    """Return the tensors of the weights that training starts from, and their file.

    Raises:
        UserError: the file has changed since the recipe was read.
    """
    path = find(weights.use)
    if sha256(path) != weights.sha256:
        raise UserError(f"train.start: the weights {path} have changed since the recipe was read: run it again")
    return read_file(path)[0], path


def _step(model: Any, optimizer: Any, fabric: "Fabric", batch: Batch, lr: float, rate: int) -> dict[str, float]:
    """Run an optimizer step of all processes, and return the losses of the whole batch."""
    for group in optimizer.param_groups:
        group["lr"] = lr * group["lr_multiplier"]
    tensors = (batch.points, batch.truth, batch.touches.points, batch.touches.mask)
    losses = model(*(fabric.to_device(tensor) for tensor in tensors), rate)
    optimizer.zero_grad()
    fabric.backward(sum(losses.values()))
    optimizer.step()
    # The shares of the processes are equal, so that the mean of their means is the mean of the batch.
    means: dict[str, torch.Tensor] = {
        name: fabric.all_reduce(loss.detach(), reduce_op="mean")  # type: ignore[misc]
        for name, loss in losses.items()
    }
    return {name: float(mean) for name, mean in means.items()}


def learning_rate(recipe: Recipe, epoch: int) -> float:
    """Return the learning rate of an epoch, which is multiplied by `decay` every `decay_every` epochs."""
    settings = recipe.train
    every = settings.decay_every or max(1, settings.epochs // 10)
    return float(settings.learning_rate * settings.decay ** (epoch // every))


def _optimizer(recipe: Recipe, model: _Training) -> torch.optim.Optimizer:
    kinds = {"adam": torch.optim.Adam, "adamw": torch.optim.AdamW}
    groups = [{"params": list(model.network.parameters()), "lr_multiplier": 1.0}]
    if own := list(model.objective.parameters()):
        groups.append({"params": own, "lr_multiplier": model.objective.lr_multiplier})
    optimizer: torch.optim.Optimizer = kinds[recipe.train.optimizer](groups, lr=recipe.train.learning_rate)
    return optimizer


def _any_process(stopped: bool, fabric: "Fabric") -> bool:
    """Return whether any process was interrupted. All stop after the same step, so that none waits for the others."""
    if fabric.world_size == 1:
        return stopped
    number = fabric.all_reduce(torch.tensor(float(stopped), device=fabric.device), reduce_op="sum")
    return bool(number > 0)  # type: ignore[operator]


@contextmanager
def _stoppable() -> Iterator[threading.Event]:
    """Set an event on SIGINT and SIGTERM instead of ending the process, so that a step is completed."""
    stop = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield stop
        return
    signals = (signal.SIGINT, signal.SIGTERM)
    old = [signal.signal(s, lambda *_: stop.set()) for s in signals]
    try:
        yield stop
    finally:
        for s, handler in zip(signals, old, strict=True):
            signal.signal(s, handler)
