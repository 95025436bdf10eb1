"""Training: batches, objective, optimizer, and a learning rate that falls (TAPSR, Sec. 4.2.2).

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
from pcsr.data.batches import Batch, Batches, usable
from pcsr.data.dataset import Split
from pcsr.data.loading import LOADERS, prepared
from pcsr.errors import UserError
from pcsr.experiments.loggers import Loggers
from pcsr.experiments.optimization import learning_rate, optimizer_of, set_learning_rate
from pcsr.experiments.recorder import Progress, Recorder
from pcsr.files import sha256
from pcsr.grafting.from_recipe import load_state
from pcsr.grafting.grafted_network import GraftedNetwork
from pcsr.network.build import build
from pcsr.network.kinds import AnyNetwork
from pcsr.plugins.registry import Registry
from pcsr.random_state import seeded
from pcsr.recipe import Recipe
from pcsr.recipe.schema import GraftedModel
from pcsr.recipe.train_section import Weights
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

    def __init__(self, network: AnyNetwork, objective: Objective) -> None:
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
    kept: Callable[[AnyNetwork, int, dict[str, Any]], object] = lambda network, step, training: None,
    checkpoint_every: float = 60.0,
    loaders: int = LOADERS,
    data_fingerprint: str | None = None,
) -> tuple[AnyNetwork, dict[str, Any]]:
    """Train the network of a recipe, from the last checkpoint in `run` if there is one of the same data.

    Args:
        recipe: the resolved recipe.
        registry: of the parts.
        data: training split.
        validation: validation split; some of it is measured during training.
        run: folder of the checkpoint and of the loggers' files.
        fabric: launched; determines device, number of processes and precision.
        shown: called after each step.
        kept: called with the network, the step and the fields of `pcsr.results.Training` up to it after each step of
            `train.snapshots`, in the first process.
        checkpoint_every: seconds between checkpoints.
        loaders: number of processes that make batches for a GPU.
        data_fingerprint: of the data; a checkpoint of other data is ignored. None: a checkpoint of any data is resumed.

    Returns:
        The trained network in `eval` mode, and the fields of `pcsr.results.Training` without the origin. The
        checkpoint stays in `run`.

    Raises:
        KeyboardInterrupt: the process was interrupted; a checkpoint of the last step is written first.
        RunError: the loss is not finite.
        UserError: the processes cannot share a batch equally, or training ends before a step of `train.snapshots`.
    """
    batches = _batches(recipe, data, fabric.world_size)
    model = _model(recipe, registry)
    optimizer = optimizer_of(recipe.train, model.network, model.objective)
    loggers = Loggers(recipe.train.loggers if fabric.is_global_zero else (), registry)
    recorder = Recorder(
        recipe,
        model.network,
        validation,
        run,
        fabric,
        loggers,
        per_epoch=batches.per_epoch,
        data_fingerprint=data_fingerprint,
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
    with _stoppable() as stop, threads(count) as used, recorder.running(model, optimizer, used):
        ahead = 0 if fabric.device.type == "cpu" else loaders
        steps = range(recorder.step, recorder.step if recorder.stopped else recorder.steps)
        for batch in prepared(batches, steps, ahead, fabric.global_rank, fabric.world_size):
            rate = learning_rate(recipe.train, recorder.step, batches.per_epoch)
            set_learning_rate(optimizer, rate)
            # What a network draws, as in dropout, depends on seed, step and process alone: a resumed training is equal.
            with seeded([recipe.seed, recorder.step, fabric.global_rank], fabric.device):
                losses, norm = _step(wrapped, optimizer, fabric, batch, recipe)
            progress = recorder.add(losses, {"learning_rate": rate, **norm})
            if fabric.is_global_zero:
                shown(progress)
                if progress.step in recipe.train.snapshots:
                    kept(recorder.network, progress.step, recorder.summary())
            if _any_process(stop.is_set(), fabric):
                recorder.save()
                raise KeyboardInterrupt
            if recorder.stopped:
                break
            recorder.save(checkpoint_every)
        recorder.save()
    return recorder.result(), recorder.summary()


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
    augment = usable(settings.augment, recipe.data.sampling)
    size = min(settings.batch, len(data))
    return Batches(data, size, recipe.touch_range, augment, recipe.seed, recipe.patches)


def _model(recipe: Recipe, registry: Registry) -> _Training:
    """Build network and objective, with initial weights determined by the recipe's seed."""
    network = initial(recipe, registry)
    with seeded([recipe.seed]):  # an objective may have random initial weights
        return _Training(network, recipe.train.objective.build(registry, "objective"))


def initial(recipe: Recipe, registry: Registry) -> AnyNetwork:
    """Build the network of a recipe with the weights that training starts from.

    Raises:
        UserError: the network cannot be built, or weights do not fit it.
    """
    network = build(recipe, registry)
    model = recipe.model
    if isinstance(network, GraftedNetwork) and isinstance(model, GraftedModel) and model.graft.weights is not None:
        load_state(network.network, model.graft.weights)
    if recipe.train.start is not None:
        fill_matching(network, *_start(recipe.train.start))
    return network


def _start(weights: Weights) -> tuple[dict[str, torch.Tensor], Path]:
    """Return the tensors of the weights that training starts from, and their file.

    Raises:
        UserError: the file has changed since the recipe was read.
    """
    path = find(weights.use)
    if sha256(path) != weights.sha256:
        raise UserError(f"train.start: the weights {path} have changed since the recipe was read: run it again")
    return read_file(path)[0], path


def _step(
    model: Any, optimizer: Any, fabric: "Fabric", batch: Batch, recipe: Recipe
) -> tuple[dict[str, float], dict[str, float]]:
    """Run an optimizer step of all processes.

    Returns:
        The losses of the whole batch, and the norm of the gradient if it is limited.
    """
    tensors = (batch.points, batch.truth, batch.touches.points, batch.touches.mask)
    losses = model(*(fabric.to_device(tensor) for tensor in tensors), recipe.network_rate)
    optimizer.zero_grad()
    total = sum(losses.values())
    if torch.is_tensor(total) and total.requires_grad:  # not in a batch without touches, of a frozen network
        fabric.backward(total)
    norm = {}
    if recipe.train.clip_norm is not None:
        # A norm that is not finite makes the next loss so, which ends the training with a message.
        clipped = fabric.clip_gradients(model, optimizer, max_norm=recipe.train.clip_norm, error_if_nonfinite=False)
        norm = {"gradient_norm": float(clipped)}  # type: ignore[arg-type]  # None for other strategies
    optimizer.step()
    # The shares of the processes are equal, so that the mean of their means is the mean of the batch.
    means: dict[str, torch.Tensor] = {
        name: fabric.all_reduce(loss.detach(), reduce_op="mean")  # type: ignore[misc]
        for name, loss in losses.items()
    }
    return {name: float(mean) for name, mean in means.items()}, norm


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
