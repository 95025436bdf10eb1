"""A foreign network and its tactile parts: one module, called as the network is.

The foreign code stays as it is. While a graft calls the network, a hook on the layer puts the fused features in
the place of the visual ones; without touches there is no hook, and the network is called as if it were alone.
"""

import threading
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from pcsr.contracts import Encoder, Fusion, TouchBatch
from pcsr.errors import UserError
from pcsr.grafting.joint import Joint, check_output, from_bnc, to_bnc, visual_points
from pcsr.network.network import fuse
from pcsr.tensors import Points

FAR = 10.0
"""Radii of a cloud: touches whose centres all lie further from its centre are in another frame or unit."""


class Grafted(nn.Module):
    """A network that hears touch at one of its layers; without touches, bit for bit the network alone."""

    def __init__(
        self,
        network: nn.Module,
        fusion: Fusion,
        touch_encoder: Encoder | None,
        joint: Joint,
        specs: dict[str, Any],
    ) -> None:
        super().__init__()
        self.network = network
        self.fusion = fusion
        self.touch_encoder = touch_encoder
        self.joint = joint
        self.specs = specs

    def forward(self, *args: Any, touches: Tensor | None = None, mask: Tensor | None = None, **kwargs: Any) -> Any:
        """What the network gives, with the touches heard at the joint.

        Args:
            *args: the network's own, handed through.
            touches: (b a m 3), in the frame and unit of the points; none by default.
            mask: (b a), False where a row holds fewer than `a` touches; all True by default.
            **kwargs: the network's own, handed through.

        Raises:
            UserError: touches of another shape, type, frame or unit than the points, or a layer that did not give
                one feature for each point, once.
        """
        if touches is None:
            if mask is not None:
                raise UserError(
                    "mask says which touches there are, but there are no touches: leave it out; an argument of the "
                    "network's own that is called mask goes by its position"
                )
            return self.network(*args, **kwargs)
        points = visual_points(self.joint, args, kwargs)
        _check_touches(points, touches, mask)
        batch = TouchBatch.of(touches, mask)
        exporting = torch.compiler.is_exporting()  # then what the tensors hold is not known
        if touches.shape[1] == 0 or not (exporting or batch.mask.any()):
            return self.network(*args, **kwargs)
        if not exporting:
            _check_frame(points, batch)
        if isinstance(self.network, Grafted):  # a second joint: both hear the same touches
            kwargs |= {"touches": touches, "mask": batch.mask}
        return self._fused(points, batch, args, kwargs)

    def tactile_parameters(self) -> Iterator[nn.Parameter]:
        """The parameters that the foreign network does not have: those of the fusion and the touch encoder."""
        foreign: nn.Module = self.network
        while isinstance(foreign, Grafted):
            foreign = foreign.network
        theirs = {id(parameter) for parameter in foreign.parameters()}
        return (parameter for parameter in self.parameters() if id(parameter) not in theirs)

    def _fused(self, points: Points, touches: TouchBatch, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        """Call the network with the hook in place, and take it away again whatever happens."""
        at, layout = self.joint.at, self.joint.layout
        caller, learning = threading.get_ident(), torch.is_grad_enabled()
        calls = 0

        def hook(_layer: nn.Module, _args: Any, output: Any) -> Tensor | None:
            nonlocal calls
            if threading.get_ident() != caller:  # replicas on several devices share the hooks of a layer
                return None
            calls += 1
            if calls > 1:
                raise UserError(f"layer '{at}' was called again within one pass: graft at a layer that is called once")
            if learning and not torch.is_grad_enabled() and any(p.requires_grad for p in self.tactile_parameters()):
                raise UserError(
                    f"layer '{at}' runs without gradients, so its graft would learn nothing: graft at a layer outside "
                    f"of torch.no_grad() and of checkpointed blocks, or call the graft under torch.no_grad()"
                )
            check_output(self.joint, output, points)
            features = to_bnc(output, layout)
            fused = fuse(self.fusion, self.touch_encoder, points, features, touches)
            if torch.compiler.is_exporting():  # `fuse` then fuses rows without touches too
                fused = torch.where(touches.mask.any(1)[:, None, None], fused, features)
            return from_bnc(fused.to(output.dtype), layout)

        handle = self.network.get_submodule(at).register_forward_hook(hook)
        try:
            result = self.network(*args, **kwargs)
        finally:
            handle.remove()
        if not calls:
            raise UserError(
                f"layer '{at}' was not called in this pass, so the touches were not heard: graft at a layer that "
                f"every pass goes through"
            )
        return result


def _check_touches(points: Points, touches: Tensor, mask: Tensor | None) -> None:
    rows = points.shape[0]
    if touches.dim() != 4 or touches.shape[0] != rows or touches.shape[3] != 3 or touches.shape[2] == 0:
        raise UserError(
            f"touches are {tuple(touches.shape)}, not (b a m 3) with b = {rows} as the points and m at least 1"
        )
    if (touches.dtype, touches.device) != (points.dtype, points.device):
        raise UserError(
            f"touches are {touches.dtype} on {touches.device}, the points {points.dtype} on {points.device}: "
            f"give touches.to(points)"
        )
    if mask is not None and (
        (mask.dtype, mask.device) != (torch.bool, touches.device) or mask.shape != touches.shape[:2]
    ):
        raise UserError(
            f"mask is {mask.dtype} {tuple(mask.shape)} on {mask.device}, not torch.bool {tuple(touches.shape[:2])} on "
            f"{touches.device}, one for each touch"
        )


def _check_frame(points: Points, touches: TouchBatch) -> None:
    """Refuse rows whose touches are all far away, or not finite: in another unit or frame than the points."""
    cloud = points.detach().float()
    centre = cloud.mean(1, keepdim=True)
    radius = (cloud - centre).norm(dim=-1).amax(1)
    distance = (touches.points.detach().float().mean(2) - centre).norm(dim=-1)  # (b a)
    far = ~(distance <= FAR * radius[:, None])
    wrong = touches.mask.any(1) & (far | ~touches.mask).all(1)
    if wrong.any():
        row = int(wrong.nonzero()[0])
        nearest = float(distance[row][touches.mask[row]].min())
        raise UserError(
            f"row {row} of the batch: its touches are {nearest:.3g} or more from the centre of a cloud of radius "
            f"{float(radius[row]):.3g}: give points and touches in one frame and unit"
        )
