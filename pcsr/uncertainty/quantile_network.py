"""Network that predicts a quantile of the errors of points from their features.

It has two hidden layers, and is fitted with the pinball loss of Koenker and Bassett, "Regression quantiles"
(Econometrica 1978): its output is the quantile itself, without an assumption on the distribution of the errors.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

LIMIT = 4.0
"""Largest absolute value of a standardised feature; others are clipped, so that unusual clouds give no wild errors."""
RESOLUTION = 0.005
"""Errors below this, in spacings, hardly count: the network predicts the logarithm of the error plus this."""
SMALLEST = 0.001
"""Smallest predicted error, in spacings."""
LAYERS = 3
"""Number of layers, the last included."""


@dataclass(frozen=True)
class QuantileNetwork:
    """Fitted network."""

    names: tuple[str, ...]
    """Names of the features, in the order of the weights."""
    mean: Float[np.ndarray, " f"]
    """Mean of each feature in the data of the fit."""
    deviation: Float[np.ndarray, " f"]
    """Standard deviation of each feature in these data."""
    weights: tuple[Float[np.ndarray, "_ _"], ...]
    biases: tuple[Float[np.ndarray, " _"], ...]

    @classmethod
    def of(cls, names: tuple[str, ...], tensors: Mapping[str, np.ndarray]) -> "QuantileNetwork":
        """Create the network from the arrays of a file: `mean`, `deviation`, `weight.0`, `bias.0` and so on."""
        weights, biases = (
            tuple(tensors[f"{kind}.{layer}"].astype(np.float64) for layer in range(LAYERS))
            for kind in ("weight", "bias")
        )
        return cls(names, tensors["mean"].astype(np.float64), tensors["deviation"].astype(np.float64), weights, biases)

    def __call__(self, features: Mapping[str, Float[np.ndarray, " n"]]) -> Float[np.ndarray, " n"]:
        """Predict the errors of points, in local spacings.

        Args:
            features: features of n points by name; further ones are not used.
        """
        stacked = np.stack([features[name] for name in self.names], axis=1)
        hidden = np.clip((stacked - self.mean) / self.deviation, -LIMIT, LIMIT)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            hidden = hidden @ weight.T + bias
            hidden = hidden / (1 + np.exp(-hidden))
        logarithm = (hidden @ self.weights[-1].T + self.biases[-1])[:, 0]
        errors: Float[np.ndarray, " n"] = np.maximum(np.exp(logarithm) - RESOLUTION, SMALLEST)
        return errors
