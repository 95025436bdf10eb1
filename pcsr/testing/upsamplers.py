"""Checks of upsamplers: their intermediate clouds."""

from typing import Any

import torch

from pcsr.testing.inputs import apart, call, given
from pcsr.testing.subject import Subject


@torch.no_grad()
def stages(subject: Subject) -> None:
    """`stages` returns clouds, the coarsest first; the last one is the output of `forward`."""
    module: Any = subject.perturbed()
    tensors = given(module, subject.widths)
    output = call(module, subject.widths.rate, tensors)
    clouds = module.stages(tensors["points"], tensors["features"], subject.widths.rate)
    if not isinstance(clouds, list) or not clouds:
        raise subject.failure(
            f"its `stages` gives {type(clouds).__name__}", "a list of clouds", "return [coarse, …, result]"
        )
    if any(cloud.dim() != 3 or cloud.shape[0] != len(output) or cloud.shape[2] != 3 for cloud in clouds):
        raise subject.failure(
            f"its stages have the shapes {[tuple(cloud.shape) for cloud in clouds]}",
            f"({len(output)}, points, 3) for each",
            "give clouds, channels last",
        )
    gap = apart(clouds[-1], output)
    if gap:
        raise subject.failure(
            f"its last stage is {gap:.2g} off the result of `forward`", "the same", "let `forward` give stages(…)[-1]"
        )
    sizes = [cloud.shape[1] for cloud in clouds]
    if sizes != sorted(sizes):
        raise subject.failure(
            f"its stages have {sizes} points",
            "the coarsest cloud first",
            "return the coarsest first",
        )
