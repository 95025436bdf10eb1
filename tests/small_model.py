"""A small model for exports, and clouds to run it on."""

import torch

from pcsr.model import Model
from pcsr.network.build import build
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import for_data, from_resolved

N, M = 64, 40
"""Points of a cloud, and of a touch."""


def tiny_model():
    """Return a model of a small network with random weights."""
    plain = for_data("cad-parts", {}, load_plugins()).resolved()
    plain["data"] |= {"rate": 4, "points": 32}
    plain["model"]["encoder"]["channels"] = plain["model"]["touch_encoder"]["channels"] = 8
    plain["model"]["backbone"] |= {"channels": [8], "neighbours": 6}
    plain["model"]["upsampler"] |= {"start": "neighbours"}
    recipe = from_resolved(plain, load_plugins())
    return Model("tiny", build(recipe, load_plugins()).eval(), recipe, {"metrics": {"cd": 0.5}}, None, ())


def clouds(batch, touches, seed=0):
    """Draw points of an ellipsoid, and touches on it if there are any."""
    draw = torch.Generator().manual_seed(seed)
    directions = torch.nn.functional.normalize(torch.randn(batch, N, 3, generator=draw), dim=-1)
    points = directions * torch.tensor([1.0, 0.8, 0.5])
    touched = points[:, :touches, None] + 0.05 * torch.randn(batch, touches, M, 3, generator=draw)
    return (points, touched) if touches else (points,)
