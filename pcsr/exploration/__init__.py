"""Where to touch next: expected contacts and gains, candidates on a guessed surface, and poses to touch."""

from pcsr.exploration.distances import mean_distances
from pcsr.exploration.gain import Expectation

__all__ = ["Expectation", "mean_distances"]
