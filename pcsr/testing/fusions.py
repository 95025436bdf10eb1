"""Checks of fusions: clouds without touches, missing touches, and the effect of touches."""

from typing import Any

import torch

from pcsr.contracts import Fusion, TouchBatch
from pcsr.errors import UserError
from pcsr.testing.behaviour import CLOSE
from pcsr.testing.check import Skipped
from pcsr.testing.inputs import BATCH, POINTS, TOUCH_POINTS, TOUCHES, apart, call, cloud, given, rows, single
from pcsr.testing.subject import Subject

ELSEWHERE = 1e3
"""Offset that is added to the contents of a missing touch."""


@torch.no_grad()
def zero_touches(subject: Subject) -> None:
    """Without touches `join` leaves the cloud as it is. Any number of touches, and of points of a touch, is accepted.

    The host does not call `forward` without touches.
    """
    module: Any = subject.perturbed().float()
    points = cloud(BATCH, POINTS).float()
    touches, mask = (
        points[:, :TOUCHES, None].expand(-1, -1, TOUCH_POINTS, -1),
        torch.ones(BATCH, TOUCHES, dtype=torch.bool),
    )
    module.join(points, TouchBatch.of(touches, mask))  # an earlier call must have no effect
    for what, count, there in (("no touch", 0, mask[:, :0]), (f"{TOUCHES} missing touches", TOUCHES, ~mask)):
        joined = module.join(points, TouchBatch.of(touches[:, :count], there))
        if not torch.equal(joined, points):
            raise subject.failure(
                f"with {what} its `join` changes a cloud of {POINTS} points into one of {joined.shape[1]}",
                "the cloud as it is",
                "join the touches where `touches.mask` is True, and nothing else",
            )
    if not module.uses_touch_features:
        return
    tensors = single(given(module, subject.widths))
    for count, size in ((1, 1), (TOUCHES, 1), (1, TOUCH_POINTS)):
        few = {name: tensor[:, :count, :size] if "touch" in name else tensor for name, tensor in tensors.items()}
        output = call(module, subject.widths.rate, {**few, "mask": tensors["mask"][:, :count]})
        if output.shape != tensors["features"].shape or not output.isfinite().all():
            raise subject.failure(
                f"with {count} touches of {size} points it gives {tuple(output.shape)}, or what is not finite",
                f"finite features of the shape {tuple(tensors['features'].shape)}",
                "take any number of touches, and of points of a touch",
            )


@torch.no_grad()
def missing_touches(subject: Subject) -> None:
    """Missing touches have no effect: a row gives the same output as alone with its own touches."""
    module: Any = subject.perturbed()
    tensors = given(module, subject.widths)
    mask = tensors["mask"].clone()
    # Rows of unequal numbers cannot be joined to their clouds in one batch.
    lacking = slice(None) if not module.uses_touch_features else slice(1, 2)
    mask[lacking, 1:] = False
    tensors["mask"] = mask
    moved = {
        name: torch.where(mask[..., None, None], tensor, tensor + ELSEWHERE) if "touch" in name else tensor
        for name, tensor in tensors.items()
    }
    output = call(module, subject.widths.rate, tensors)
    gap = apart(call(module, subject.widths.rate, moved), output)
    if gap > CLOSE:
        raise subject.failure(
            f"the contents of a missing touch change the result by {gap:.2g}",
            "that only touches with a True `mask` have an effect",
            "leave the others out: with attention by TouchBatch.flat_padding, in a mean by the mask",
        )
    own = {name: tensor[:, :1] if "touch" in name else tensor for name, tensor in rows(tensors, slice(1, 2)).items()}
    gap = apart(call(module, subject.widths.rate, {**own, "mask": mask[1:2, :1]}), output[1:2])
    if gap > CLOSE:
        raise subject.failure(
            f"a cloud with 1 touch comes out {gap:.2g} off where another of its batch has {TOUCHES}",
            "the same result",
            "count touches by the mask, not by the shape",
        )


@torch.no_grad()
def uses_touches(subject: Subject) -> None:
    """Other touches give another output."""
    module: Any = subject.perturbed()
    joins = type(module).join is not Fusion.join
    if not (module.uses_touch_features or joins or module.keeps_touched_points):
        raise subject.failure(
            "it uses no touch features, joins no points and keeps none, so that touches have no effect",
            "one of the three",
            "set uses_touch_features or keeps_touched_points = True, or override `join`",
        )
    if module.keeps_touched_points and not module.uses_touch_features:
        raise Skipped(f"{subject} keeps touched points, which the host inserts into the result")
    tensors = given(module, subject.widths)
    other = {name: tensor.flip(0) if "touch" in name else tensor for name, tensor in tensors.items()}
    if torch.equal(call(module, subject.widths.rate, tensors), call(module, subject.widths.rate, other)):
        raise subject.failure(
            "other touches change nothing", "an effect of the touches", "use the touches in `forward`"
        )
    if joins:
        _joined(subject, module)


def _joined(subject: Subject, module: Any) -> None:
    tensors = given(module, subject.widths)
    points = tensors["points"]
    joined = module.join(points, TouchBatch.of(tensors["touches"], tensors["mask"]))
    kept = torch.cdist(points, joined).amin(2).max() if joined.dim() == 3 and len(joined) == len(points) else None
    if kept is None or kept > CLOSE:
        raise subject.failure(
            f"its `join` gives {tuple(joined.shape)} for {tuple(points.shape)}, and points of the cloud are not in it",
            "the cloud with points added",
            "use torch.cat([points, …], dim=1)",
        )


def ragged_join(subject: Subject) -> None:
    """Rows with different numbers of touches are joined, or refused with a message that names the part."""
    module: Any = subject.perturbed()
    if type(module).join is Fusion.join:
        raise Skipped(f"{subject} does not join touches to the cloud")
    points = cloud(BATCH, POINTS)
    touches, mask = (
        points[:, :TOUCHES, None].expand(-1, -1, TOUCH_POINTS, -1),
        torch.ones(BATCH, TOUCHES, dtype=torch.bool),
    )
    mask[0, 0] = False
    try:
        module.join(points, TouchBatch.of(touches, mask))
    except UserError as error:
        subject.must_name_itself(error)
