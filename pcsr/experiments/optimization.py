"""Optimizer and learning rate of a training.

The learning rate is a function of the step alone, unlike with the schedulers of torch, whose rate follows from the last
one. So a training that is resumed has the same rates as one that was never interrupted.
"""

import math

import torch
from torch import nn

from pcsr.contracts import Objective
from pcsr.recipe.optimizers import OPTIMIZERS
from pcsr.recipe.train_section import Train


def optimizer_of(train: Train, network: nn.Module, objective: Objective) -> torch.optim.Optimizer:
    """Create the optimizer of a network's weights, and of those of the objective in a group of their own."""
    trained = [weight for weight in network.parameters() if weight.requires_grad]
    groups = [{"params": trained, "lr_multiplier": 1.0}]
    if own := list(objective.parameters()):
        groups.append({"params": own, "lr_multiplier": objective.lr_multiplier})
    kind = OPTIMIZERS[train.optimizer.use]
    optimizer: torch.optim.Optimizer = kind(groups, lr=train.learning_rate, **train.optimizer.options)
    return optimizer


def set_learning_rate(optimizer: torch.optim.Optimizer, rate: float) -> None:
    """Set the learning rate of the next step. Groups of weights have it times their `lr_multiplier`."""
    for group in optimizer.param_groups:
        group["lr"] = rate * group["lr_multiplier"]


def learning_rate(train: Train, step: int, per_epoch: int) -> float:
    """Return the learning rate of a step.

    Args:
        train: settings of the training.
        step: number of steps before this one.
        per_epoch: number of steps in an epoch.
    """
    warmup, steps = int(train.warmup * per_epoch), train.epochs * per_epoch
    if train.schedule == "steps":
        every = train.decay_every or max(1, train.epochs // 10)
        rate = float(train.learning_rate * train.decay ** (step // per_epoch // every))
    else:
        done = max(0, step - warmup) / max(1, steps - warmup)
        left = (1 + math.cos(math.pi * done)) / 2 if train.schedule == "cosine" else 1 - done
        rate = train.final_learning_rate + left * (train.learning_rate - train.final_learning_rate)
    return rate * (step + 1) / (warmup + 1) if step < warmup else rate
