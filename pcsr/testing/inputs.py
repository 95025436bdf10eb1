"""What parts are tried on: clouds, features and touches, and one way to call a network part of any kind."""

from collections.abc import Mapping
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcsr.contracts import Encoder, Fusion, TouchBatch, Upsampler, Widths

BATCH, POINTS, TOUCHES, FELT = 3, 128, 2, 24
"""Clouds of a batch, points of a cloud, touches of a cloud, points of a touch."""
FEW = 64
"""Points of a cloud where a check calls a part often: no part may need more neighbours than there are points here."""

Given = dict[str, Tensor]
"""Tensors by name: points (b n 3), features (b n c), touches (b a m 3), touch_features (b a m c), mask (b a)."""


def cloud(batch: int, count: int, seed: int = 0) -> Float[Tensor, "b n 3"]:
    """Random points of a lopsided, bumpy surface in the unit sphere, in double precision; each cloud is another."""
    random = torch.Generator().manual_seed(seed)
    ways = torch.randn(batch, count, 3, generator=random, dtype=torch.float64)
    ways = ways / ways.norm(dim=-1, keepdim=True)
    x, y, z = ways.unbind(-1)
    radius = 0.8 + 0.1 * torch.sin(3 * x + 2 * y) + 0.1 * torch.cos(4 * z)
    points: Tensor = radius.unsqueeze(-1) * ways * torch.tensor([1.0, 0.8, 0.6], dtype=torch.float64)
    return points


def given(module: nn.Module, widths: Widths, *, batch: int = BATCH, count: int = POINTS, seed: int = 0) -> Given:
    """All that a network part takes, in double precision; a mask without gaps."""
    random = torch.Generator().manual_seed(seed + 1)

    def draw(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=random, dtype=torch.float64)

    points = cloud(batch, count, seed)
    everything = {
        "points": points,
        "features": draw(batch, count, widths.refined if isinstance(module, Upsampler) else widths.visual),
        "touches": points[:, :TOUCHES, None] + 0.1 * draw(batch, TOUCHES, FELT, 3),
        "touch_features": draw(batch, TOUCHES, FELT, widths.touch),
        "mask": torch.ones(batch, TOUCHES, dtype=torch.bool),
    }
    return {name: everything[name] for name in takes(module)}


def takes(module: nn.Module) -> tuple[str, ...]:
    """Names of what a part takes. A fusion that hears no features is called by its other door, `join`."""
    if isinstance(module, Encoder):
        return ("points",)
    if isinstance(module, Fusion):
        heard = ("features", "touch_features") if module.uses_touch_features else ()
        return ("points", "touches", "mask", *heard)
    return ("points", "features")


def learns_from(module: nn.Module) -> tuple[str, ...]:
    """Of these, what gradients must reach: whatever learned parts made."""
    if isinstance(module, Fusion) and not module.uses_touch_features:
        return ("touches",)
    return tuple(name for name in takes(module) if name.endswith("features"))


def is_set(module: nn.Module) -> bool:
    """Whether the order of the points that it gives means nothing."""
    return isinstance(module, Upsampler) or (isinstance(module, Fusion) and not module.uses_touch_features)


def call(module: nn.Module, rate: int, tensors: Mapping[str, Tensor]) -> Tensor:
    """What a part gives for `tensors`."""
    made: Any
    if isinstance(module, Encoder):
        made = module(tensors["points"])
    elif isinstance(module, Fusion) and module.uses_touch_features:
        touches = TouchBatch(tensors["touches"], tensors["touch_features"], tensors["mask"])
        made = module(tensors["points"], tensors["features"], touches)
    elif isinstance(module, Fusion):
        made = module.join(tensors["points"], TouchBatch.of(tensors["touches"], tensors["mask"]))
    elif isinstance(module, Upsampler):
        made = module(tensors["points"], tensors["features"], rate)
    else:
        made = module(tensors["points"], tensors["features"])
    if not isinstance(made, Tensor):
        raise TypeError(f"it gives a {type(made).__name__}, not a tensor")
    return made


def rows(tensors: Given, which: slice) -> Given:
    """Some clouds of a batch."""
    return {name: tensor[which] for name, tensor in tensors.items()}


def single(tensors: Given) -> Given:
    """In single precision, as the host calls parts."""
    return {name: t.float() if t.is_floating_point() else t for name, t in tensors.items()}


def apart(one: Tensor, other: Tensor) -> float:
    """Greatest difference of two results, relative to their size where that is above 1; infinite for other shapes."""
    if one.shape != other.shape:
        return float("inf")
    if one.numel() == 0:
        return 0.0
    gap = (one - other).abs().max() / other.abs().max().clamp_min(1.0)
    return float(gap) if gap.isfinite() else float("inf")


def apart_as_sets(one: Tensor, other: Tensor) -> float:
    """The same for clouds whose order means nothing: how far a point is from the nearest of the other cloud."""
    if one.shape != other.shape:
        return float("inf")
    distance = torch.cdist(one, other, compute_mode="donot_use_mm_for_euclid_dist")
    gap = torch.maximum(distance.amin(1).max(), distance.amin(2).max()) / other.abs().max().clamp_min(1.0)
    return float(gap) if gap.isfinite() else float("inf")
