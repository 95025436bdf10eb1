"""Early stopping: training ends when the validation error has stopped falling."""

import math
from collections.abc import Mapping

import torch
from torch import Tensor, nn


class EarlyStopping:
    """Counts validations without improvement, and keeps the weights of the lowest validation error."""

    def __init__(self, patience: int) -> None:
        """Create a counter; `patience` is the number of validations without improvement that ends the training."""
        self.patience = patience
        self.lowest, self.step, self.since = math.inf, 0, 0
        self.weights: dict[str, Tensor] = {}

    def add(self, error: float, step: int, network: nn.Module) -> None:
        """Record a validation error of the network after a step."""
        self.since += 1
        if error < self.lowest:
            self.lowest, self.step, self.since = error, step, 0
            self.weights = {name: tensor.detach().clone() for name, tensor in network.state_dict().items()}

    @property
    def due(self) -> bool:
        """Whether training ends now."""
        return self.since >= self.patience

    def restore(self, network: nn.Module) -> None:
        """Load the weights of the lowest validation error into the network, if there are any."""
        if self.weights:
            network.load_state_dict(self.weights)

    def state_dict(self) -> dict[str, Tensor]:
        """Return the state for a checkpoint."""
        about = torch.tensor([self.lowest, self.step, self.since], dtype=torch.float64)
        return {"about": about, **{f"weights.{name}": tensor for name, tensor in self.weights.items()}}

    def load_state_dict(self, state: Mapping[str, Tensor]) -> None:
        """Restore the state from a checkpoint."""
        lowest, step, since = state["about"].tolist()
        self.lowest, self.step, self.since = lowest, int(step), int(since)
        prefix = "weights."
        self.weights = {n.removeprefix(prefix): t for n, t in state.items() if n.startswith(prefix)}
