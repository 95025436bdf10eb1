"""Average of a network's weights over the steps of its training."""

from torch import nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn, get_swa_multi_avg_fn

from pcsr.recipe.train_section import Average

DECAY = 0.999
"""Weight of the previous average in the next one, for `ema`, by default."""
LAST = 0.25
"""Share of the epochs that the mean is taken of, for `swa`, by default."""


class WeightAverage:
    """Exponential moving average or mean of a network's weights, by `torch.optim.swa_utils`.

    Buffers are not averaged: they are those of the last step.
    """

    def __init__(self, network: nn.Module, settings: Average, epochs: int, per_epoch: int) -> None:
        """Create an average of no steps.

        Args:
            network: network that is trained. It is copied.
            settings: kind, decay and start of the average.
            epochs: number of epochs of the training.
            per_epoch: number of steps in an epoch.
        """
        swa = settings.use == "swa"
        start = settings.start if settings.start is not None else epochs - max(1, round(LAST * epochs)) if swa else 0
        self.after = start * per_epoch
        average = get_swa_multi_avg_fn() if swa else get_ema_multi_avg_fn(settings.decay or DECAY)
        self.model = AveragedModel(network, multi_avg_fn=average)

    def add(self, network: nn.Module, step: int) -> None:
        """Add the weights after a step, unless the average begins later."""
        if step > self.after:
            self.model.update_parameters(network)

    @property
    def network(self) -> nn.Module | None:
        """Network with the averaged weights; None before the average begins."""
        return self.model.module if int(self.model.n_averaged) else None
