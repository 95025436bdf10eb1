"""Inputs of the checks, and a call of network parts that is the same for all kinds."""

from collections.abc import Mapping
from typing import Any

import torch
from jaxtyping import Float
from torch import Tensor, nn

from pcsr.contracts import Encoder, Fusion, TouchBatch, Upsampler, Widths

BATCH, POINTS, TOUCHES, TOUCH_POINTS = 3, 128, 2, 24
"""Numbers of clouds in a batch, points in a cloud, touches of a cloud, and points in a touch."""
FEW = 64
"""Number of points in a cloud where a check calls a part often. No part may need more neighbours than this."""

Given = dict[str, Tensor]
"""Tensors by name: points (b n 3), features (b n c), touches (b a m 3), touch_features (b a m c), mask (b a)."""


def cloud(batch: int, count: int, seed: int = 0) -> Float[Tensor, "b n 3"]:
    """Generate random points of an asymmetric, wavy surface in the unit sphere, in double precision."""
    random = torch.Generator().manual_seed(seed)
    directions = torch.randn(batch, count, 3, generator=random, dtype=torch.float64)
    directions = directions / directions.norm(dim=-1, keepdim=True)
    x, y, z = directions.unbind(-1)
    radius = 0.8 + 0.1 * torch.sin(3 * x + 2 * y) + 0.1 * torch.cos(4 * z)
    points: Tensor = radius.unsqueeze(-1) * directions * torch.tensor([1.0, 0.8, 0.6], dtype=torch.float64)
    return points


def given(module: nn.Module, widths: Widths, *, batch: int = BATCH, count: int = POINTS, seed: int = 0) -> Given:
    """Generate the inputs of a network part in double precision; every touch is present."""
    random = torch.Generator().manual_seed(seed + 1)

    def draw(*shape: int) -> Tensor:
        return torch.randn(*shape, generator=random, dtype=torch.float64)

    points = cloud(batch, count, seed)
    everything = {
        "points": points,
        "features": draw(batch, count, widths.refined if isinstance(module, Upsampler) else widths.visual),
        "touches": points[:, :TOUCHES, None] + 0.1 * draw(batch, TOUCHES, TOUCH_POINTS, 3),
        "touch_features": draw(batch, TOUCHES, TOUCH_POINTS, widths.touch),
        "mask": torch.ones(batch, TOUCHES, dtype=torch.bool),
    }
    return {name: everything[name] for name in takes(module)}


def takes(module: nn.Module) -> tuple[str, ...]:
    """Names of the inputs of a part. `join` is called of a fusion that uses no touch features."""
    if isinstance(module, Encoder):
        return ("points",)
    if isinstance(module, Fusion):
        features = ("features", "touch_features") if module.uses_touch_features else ()
        return ("points", "touches", "mask", *features)
    return ("points", "features")


def learns_from(module: nn.Module) -> tuple[str, ...]:
    """Names of the inputs that must receive gradients: outputs of other trained parts."""
    if isinstance(module, Fusion) and not module.uses_touch_features:
        return ("touches",)
    return tuple(name for name in takes(module) if name.endswith("features"))


def is_set(module: nn.Module) -> bool:
    """Whether the output is a set of points, whose order has no meaning."""
    return isinstance(module, Upsampler) or (isinstance(module, Fusion) and not module.uses_touch_features)


def call(module: nn.Module, rate: int, tensors: Mapping[str, Tensor]) -> Tensor:
    """Call a part with `tensors`."""
    output: Any
    if isinstance(module, Encoder):
        output = module(tensors["points"])
    elif isinstance(module, Fusion) and module.uses_touch_features:
        touches = TouchBatch(tensors["touches"], tensors["touch_features"], tensors["mask"])
        output = module(tensors["points"], tensors["features"], touches)
    elif isinstance(module, Fusion):
        output = module.join(tensors["points"], TouchBatch.of(tensors["touches"], tensors["mask"]))
    elif isinstance(module, Upsampler):
        output = module(tensors["points"], tensors["features"], rate)
    else:
        output = module(tensors["points"], tensors["features"])
    if not isinstance(output, Tensor):
        raise TypeError(f"it gives a {type(output).__name__}, not a tensor")
    return output


def outputs(module: nn.Module, rate: int, tensors: Mapping[str, Tensor]) -> list[Tensor]:
    """Call a part and return its outputs: of an upsampler that predicts errors, these too."""
    if isinstance(module, Upsampler):
        dense, errors = module.with_errors(tensors["points"], tensors["features"], rate)
        return [dense] if errors is None else [dense, errors]
    return [call(module, rate, tensors)]


def rows(tensors: Given, which: slice) -> Given:
    """Select clouds of a batch."""
    return {name: tensor[which] for name, tensor in tensors.items()}


def single(tensors: Given) -> Given:
    """Convert to single precision, in which the host calls parts."""
    return {name: t.float() if t.is_floating_point() else t for name, t in tensors.items()}


def apart(one: Tensor, other: Tensor) -> float:
    """Largest difference of two outputs, relative to their size if that is above 1; infinite if shapes differ."""
    if one.shape != other.shape:
        return float("inf")
    if one.numel() == 0:
        return 0.0
    gap = (one - other).abs().max() / other.abs().max().clamp_min(1.0)
    return float(gap) if gap.isfinite() else float("inf")


def apart_as_sets(one: Tensor, other: Tensor) -> float:
    """Hausdorff distance of two clouds, relative to their size if that is above 1; infinite if shapes differ."""
    if one.shape != other.shape:
        return float("inf")
    distance = torch.cdist(one, other, compute_mode="donot_use_mm_for_euclid_dist")
    gap = torch.maximum(distance.amin(1).max(), distance.amin(2).max()) / other.abs().max().clamp_min(1.0)
    return float(gap) if gap.isfinite() else float("inf")
