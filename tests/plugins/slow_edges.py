"""Neighbours and edges one at a time."""

import torch

from pcsr_plugins.layers.edge_conv import EdgeConv


def nearest(x: torch.Tensor, k: int) -> list[list[int]]:
    """For each row of (n d) the k nearest other rows."""
    distance = torch.cdist(x.double(), x.double(), compute_mode="donot_use_mm_for_euclid_dist")
    return [[int(j) for j in row.argsort() if j != i][:k] for i, row in enumerate(distance)]


def edge(layer: EdgeConv, own: torch.Tensor, other: torch.Tensor) -> torch.Tensor:
    """One edge's message, before the maximum."""
    return torch.relu(layer.message(other - own) + layer.centre(own))
