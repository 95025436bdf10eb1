"""Candidates along the edges to neighbours, displaced along the normal and thinned to be even. Our own.

An MLP on rotation-invariant edge features predicts for each candidate a displacement along the normal and a factor (0
to 2) of its step along the edge, both in proportion to the local roughness: flat regions stay flat, even ones even.
There are twice as many candidates as are wanted, and the host keeps the farthest points: evenness weighs as much in
every metric as the distance to the surface (docs/decisions.md). One network serves every rate and every rotation.
Zero-initialised: before training it is the interpolation.
"""

import torch

from pcsr.tensors import Dense, Features, Points
from pcsr_plugins.layers.edge_candidates import EdgeCandidates
from pcsr_plugins.layers.local_frames import LocalFrames


class EdgeOffsets(EdgeCandidates):
    """Displaces candidates on edges by an MLP on the edge's features, in units of the local spacing."""

    def forward(self, points: Points, features: Features, rate: int) -> Dense:
        """The points themselves, and `surplus`·rate·n displaced candidates, or a few more."""
        candidates = [
            candidate for candidate, _ in self.rings(LocalFrames.of(points, self.neighbours), points, features, rate)
        ]
        return torch.cat([points.unsqueeze(2), *candidates], dim=2).flatten(1, 2)
