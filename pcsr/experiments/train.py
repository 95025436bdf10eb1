"""Training: batches, objective, Adam, a learning rate that falls in steps (TAPSR, Sec. 4.2.2).

On Lightning Fabric, so that several processes, nodes or GPUs and mixed precision go the same path as one CPU.
"""

import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import torch
from torch import nn

from pcsr.contracts import Objective, TouchBatch
from pcsr.data.batches import Batch, Batches
from pcsr.data.dataset import Split
from pcsr.data.loading import LOADERS, prepared
from pcsr.errors import RunError, UserError
from pcsr.experiments.history import History
from pcsr.metrics.chamfer import chamfer
from pcsr.network.load import load_training, save_training
from pcsr.network.network import Network, build
from pcsr.plugins.registry import Registry
from pcsr.recipe import Recipe
from pcsr.threads import deserved, threads
from pcsr.upsample import points_at_once, upsample_as
from pcsr.weights.file import read_file

if TYPE_CHECKING:
    from lightning_fabric import Fabric

CHECKPOINT = "checkpoint.safetensors"
HISTORY = "metrics.jsonl"
WATCHED = 16
"""Objects of the validation split that are measured on the way: enough to see where it goes."""


@dataclass(frozen=True)
class Progress:
    """Where a training run stands, after each step."""

    step: int
    steps: int
    loss: float
    seconds: float
    """Since this process began to train; what went before a stop is not in it."""


class _Training(nn.Module):
    """Network and objective behind one forward, which is what a data-parallel wrapper hooks into.

    It takes tensors alone, since Lightning Fabric converts no other arguments to the precision of a run.
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
    checkpoint_every: float = 60.0,
    loaders: int = LOADERS,
    data_fingerprint: str | None = None,
) -> Network:
    """Train a recipe's network, from the last checkpoint in `run` if there is one of the same data.

    Args:
        recipe: the resolved recipe.
        registry: where its parts come from.
        data: what to train on.
        validation: some of it is measured ten times on the way.
        run: takes the checkpoint and `metrics.jsonl`.
        fabric: launched; says where to compute, with how many processes, in which precision.
        shown: called after each step.
        checkpoint_every: seconds between checkpoints.
        loaders: processes that make batches, for a GPU.
        data_fingerprint: of the data; a checkpoint of other data is left aside. None: any will do.

    Returns:
        The trained network in `eval` mode. The checkpoint stays in `run`.

    Raises:
        KeyboardInterrupt: somebody stopped it; the checkpoint of that very step is written first.
        RunError: the loss is not finite.
    """
    settings = recipe.train
    if settings.batch % fabric.world_size:
        raise UserError(
            f"train.batch is {settings.batch}, which {fabric.world_size} processes cannot share equally: "
            f"make it a multiple of {fabric.world_size}"
        )
    # Drawn anew, a cloud that was seen from one side or spaced out would no longer be one.
    anew = recipe.data.sampling in ("random", "mixed")
    augment = [name for name in settings.augment if name != "redraw" or anew]
    watched = validation.spread(min(WATCHED, len(validation)))
    size = min(settings.batch, len(data))
    batches = Batches(data, size, recipe.touch_range, augment, recipe.seed, recipe.patches)
    network = build(recipe, registry)
    with torch.random.fork_rng(devices=[]):  # an objective may have weights that begin at random
        torch.manual_seed(recipe.seed)
        model = _Training(network, settings.objective.build(registry, "objective"))
    optimizer = _optimizer(recipe, model)
    checkpoint, history = run / CHECKPOINT, History(run / HISTORY)
    step, before = 0, 0.0
    count = deserved(size // fabric.world_size * recipe.network_points, network.parameter_count)
    if checkpoint.exists() and _is_of(checkpoint, data_fingerprint):
        about = load_training(checkpoint, model, optimizer)
        step, before = about["step"], about["seconds"]
        # With another number of threads sums are rounded otherwise, on a machine with more cores for one.
        count = about.get("threads", count)
    history.cut(step)
    wrapped, optimizer = fabric.setup(model, optimizer)
    steps = settings.epochs * batches.per_epoch
    every = max(1, settings.epochs // 10) * batches.per_epoch
    start = saved = time.monotonic()

    def save() -> None:
        if fabric.is_global_zero:
            seconds = before + time.monotonic() - start
            about = {"step": step, "seconds": seconds, "threads": used, "data_fingerprint": data_fingerprint}
            save_training(checkpoint, model, optimizer, about)

    with _stoppable() as stop, threads(count) as used:
        ahead = 0 if fabric.device.type == "cpu" else loaders
        for batch in prepared(batches, range(step, steps), ahead, fabric.global_rank, fabric.world_size):
            rate = learning_rate(recipe, step // batches.per_epoch)
            losses = _step(wrapped, optimizer, fabric, batch, rate, recipe.network_rate)
            step += 1
            total = sum(losses.values())
            if not math.isfinite(total):
                raise RunError(
                    f"the loss is {total} at step {step} of {steps} ({losses}): lower train.learning_rate, or look into "
                    f"the parts; the checkpoint before it is kept in {checkpoint}"
                )
            seconds = time.monotonic() - start
            if fabric.is_global_zero:
                epoch = step // batches.per_epoch
                history.add(
                    {
                        "step": step,
                        "epoch": epoch,
                        "loss": total,
                        "losses": losses,
                        "rate": rate,
                        "seconds": round(before + seconds, 2),
                        "threads": used,
                    }
                )
                if step % every == 0 or step == steps:
                    history.add(
                        {
                            "epoch": epoch,
                            "step": step,
                            "validation": {"cd": validate(network, watched, recipe)},
                        }
                    )
                shown(Progress(step, steps, total, seconds))
            if _anybody(stop.is_set(), fabric):
                save()
                raise KeyboardInterrupt
            if time.monotonic() - saved > checkpoint_every:
                save()
                saved = time.monotonic()
        save()
    return network.eval()


def _is_of(checkpoint: Path, data_fingerprint: str | None) -> bool:
    """Whether a checkpoint is of these data; one that doesn't say is of the only data that its folder ever had."""
    of = read_file(checkpoint, tensors=False)[1].get("data_fingerprint")
    return of is None or data_fingerprint is None or of == data_fingerprint


def _step(model: Any, optimizer: Any, fabric: "Fabric", batch: Batch, rate: float, upsampling: int) -> dict[str, float]:
    """One step of all processes together; the losses are those of the whole batch."""
    for group in optimizer.param_groups:
        group["lr"] = rate * group["lr_multiplier"]
    tensors = (batch.points, batch.truth, batch.touches.points, batch.touches.mask)
    losses = model(*(fabric.to_device(tensor) for tensor in tensors), upsampling)
    optimizer.zero_grad()
    fabric.backward(sum(losses.values()))
    optimizer.step()
    # One number each, averaged over processes: the mean of equal shares is the mean of the batch.
    means: dict[str, torch.Tensor] = {
        name: fabric.all_reduce(loss.detach(), reduce_op="mean")  # type: ignore[misc]
        for name, loss in losses.items()
    }
    return {name: float(mean) for name, mean in means.items()}


def learning_rate(recipe: Recipe, epoch: int) -> float:
    """The learning rate of an epoch: it falls by the factor `decay` every `decay_every` epochs."""
    settings = recipe.train
    every = settings.decay_every or max(1, settings.epochs // 10)
    return float(settings.learning_rate * settings.decay ** (epoch // every))


@torch.no_grad()
def validate(network: Network, split: Split, recipe: Recipe) -> float:
    """Mean Chamfer distance over a split, with the recipe's number of touches, in the truth's unit sphere."""
    network.eval()
    values = []
    with threads(deserved(points_at_once(recipe), network.parameter_count)):
        for i in range(len(split)):
            touches = list(split.touches[i][: recipe.data.touches].numpy())
            dense = upsample_as(recipe, network, split.points[i].numpy(), touches)
            values.append(float(chamfer(torch.from_numpy(dense)[None].float(), split.truth[i][None])))
    network.train()
    return sum(values) / len(values)


def _optimizer(recipe: Recipe, model: _Training) -> torch.optim.Optimizer:
    kinds = {"adam": torch.optim.Adam, "adamw": torch.optim.AdamW}
    groups = [{"params": list(model.network.parameters()), "lr_multiplier": 1.0}]
    if own := list(model.objective.parameters()):
        groups.append({"params": own, "lr_multiplier": model.objective.lr_multiplier})
    optimizer: torch.optim.Optimizer = kinds[recipe.train.optimizer](groups, lr=recipe.train.learning_rate)
    return optimizer


def _anybody(stopped: bool, fabric: "Fabric") -> bool:
    """Whether any process was told to stop: all do, after the same step, or some would wait for the others."""
    if fabric.world_size == 1:
        return stopped
    told = fabric.all_reduce(torch.tensor(float(stopped), device=fabric.device), reduce_op="sum")
    return bool(told > 0)  # type: ignore[operator]


@contextmanager
def _stoppable() -> Iterator[threading.Event]:
    """Ctrl-C or a polite kill sets the event; the step in hand ends first."""
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
