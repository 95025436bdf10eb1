"""A foreign network and its tactile parts as one module, which is called like the network.

The foreign code is not changed. During a call of the graft a forward hook replaces the output of one layer by the fused
features. Without touches there is no hook.
"""

import threading
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from pcsr.contracts import Encoder, Fusion, TouchBatch
from pcsr.errors import UserError
from pcsr.geometry.checks import check_frame
from pcsr.grafting.calling import Calling
from pcsr.grafting.fuse import fuse
from pcsr.grafting.injection_point import InjectionPoint, check_output, from_bnc, to_bnc, visual_points
from pcsr.grafting.layer_points import LayerPoints
from pcsr.tensors import Points

MOST_DISTANCE = 5.0
"""Largest distance between the centres of a cloud and of its nearest touch, in diameters of the cloud."""


class Grafted(nn.Module):
    """A network with touch at one of its layers. Without touches its output is that of the network, bit for bit.

    While it is `frozen`, the network stays in `eval` mode when the graft is trained, so that the statistics of its
    normalisation layers do not change. Set `grafted.frozen = False` to train the network along.

    Examples:
        >>> network = torch.nn.Sequential(torch.nn.Linear(3, 16), torch.nn.ReLU(), torch.nn.Linear(16, 3))
        >>> grafted = pcsr.graft(network, at="0")
        >>> points = torch.rand(1, 32, 3)
        >>> torch.equal(grafted(points), network(points))
        True
        >>> grafted.train().network.training
        False
        >>> len(list(grafted.tactile_parameters())) > 0
        True
    """

    def __init__(
        self,
        network: nn.Module,
        fusion: Fusion,
        touch_encoder: Encoder | None,
        injection_point: InjectionPoint,
        specs: dict[str, Any],
        calling: Calling | None = None,
        *,
        frozen: bool = True,
    ) -> None:
        super().__init__()
        self.network = network
        self.fusion = fusion
        self.touch_encoder = touch_encoder
        self.injection_point = injection_point
        self.specs = specs
        self.calling = calling
        self.frozen = frozen
        self._freeze()

    def train(self, mode: bool = True) -> "Grafted":
        """Set the mode of the tactile parts, and of the network unless it is `frozen`."""
        super().train(mode)
        self._freeze()
        return self

    def _freeze(self) -> None:
        if self.frozen and not isinstance(self.network, Grafted):  # a graft freezes its own network
            self.network.eval()

    def forward(self, *args: Any, touches: Tensor | None = None, mask: Tensor | None = None, **kwargs: Any) -> Any:
        """Run the network, with touches fused into the output of the grafted layer.

        Args:
            *args: positional arguments of the network.
            touches: touched points, (b a m 3), in the frame and unit of the points; none by default.
            mask: which touches are present, (b a); all by default.
            **kwargs: keyword arguments of the network.

        Returns:
            The output of the network.

        Raises:
            UserError: the touches differ in shape, type, frame or unit from the points, or the layer did not give one
                feature for each point, once.
        """
        if touches is None:
            if mask is not None:
                raise UserError(
                    "a mask is given, but there are no touches: leave it out; pass an argument of the network that "
                    "is called mask by its position"
                )
            return self.network(*args, **kwargs)
        points = visual_points(self.injection_point, args, kwargs)
        _check_touches(points, touches, mask)
        batch = TouchBatch.of(touches, mask)
        exporting = torch.compiler.is_exporting()  # the values of tensors are then unknown
        if touches.shape[1] == 0 or not (exporting or batch.mask.any()):
            return self.network(*args, **kwargs)
        if not exporting:
            _check_frame(points, batch)
        if isinstance(self.network, Grafted):  # both grafts get the same touches
            kwargs |= {"touches": touches, "mask": batch.mask}
        return self._fused(points, batch, args, kwargs)

    def tactile_parameters(self) -> Iterator[nn.Parameter]:
        """Parameters that the foreign network does not have: those of the fusion and the touch encoder."""
        foreign: nn.Module = self.network
        while isinstance(foreign, Grafted):
            foreign = foreign.network
        of_foreign = {id(parameter) for parameter in foreign.parameters()}
        return (parameter for parameter in self.parameters() if id(parameter) not in of_foreign)

    def _fused(self, points: Points, touches: TouchBatch, args: Sequence[Any], kwargs: Mapping[str, Any]) -> Any:
        """Call the network with a hook on the grafted layer, and remove the hook in any case."""
        at, layout = self.injection_point.at, self.injection_point.layout
        caller, learning = threading.get_ident(), torch.is_grad_enabled()
        calls = 0

        layer_points = LayerPoints(self.injection_point, points)

        def here() -> bool:  # replicas on several devices share a layer's hooks
            return threading.get_ident() == caller

        def hook(_layer: nn.Module, _args: Any, output: Any) -> Tensor | None:
            nonlocal calls
            if not here():
                return None
            calls += 1
            if calls > 1:
                raise UserError(f"layer '{at}' was called again within one pass: graft at a layer that is called once")
            if learning and not torch.is_grad_enabled() and any(p.requires_grad for p in self.tactile_parameters()):
                raise UserError(
                    f"layer '{at}' runs without gradients, so that the tactile parts cannot be trained: graft at "
                    f"a layer outside of torch.no_grad() and checkpointed blocks, or call it under torch.no_grad()"
                )
            check_output(self.injection_point, output, points)
            features = to_bnc(output, layout)
            fused = fuse(self.fusion, self.touch_encoder, layer_points.get(), features, touches)
            if torch.compiler.is_exporting():  # `fuse` then fuses rows without touches too
                fused = torch.where(touches.mask.any(1)[:, None, None], fused, features)
            return from_bnc(fused.to(output.dtype), layout)

        handles = layer_points.watch(self.network, here)
        handles.append(self.network.get_submodule(at).register_forward_hook(hook))
        try:
            result = self.network(*args, **kwargs)
        finally:
            for handle in handles:
                handle.remove()
        if not calls:
            raise UserError(
                f"layer '{at}' was not called in this pass, so the touches had no effect: graft at a layer that "
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
    """Refuse touches that are not finite, and rows whose touches are all far away: in another unit or frame."""
    finite = touches.points.isfinite().flatten(2).all(2) | ~touches.mask
    for row, whole in enumerate(finite.all(1).tolist()):
        if not whole:
            raise UserError(f"row {row} of the batch: a touch has coordinates that are not finite: mask it")
    cloud = points.detach().float()
    centre = cloud.mean(1, keepdim=True)
    radius = (cloud - centre).norm(dim=-1).amax(1)
    distance = (touches.points.detach().float().mean(2) - centre).norm(dim=-1)  # (b a)
    nearest = distance.masked_fill(~touches.mask, torch.inf).amin(1)
    for row, (away, reach, touched) in enumerate(torch.stack([nearest, radius, touches.mask.any(1)], 1).tolist()):
        if touched:
            check_frame(
                f"row {row} of the batch: its nearest touch",
                "the centre of its cloud",
                distance=away,
                extent=2 * reach,
                most_distance=MOST_DISTANCE,
            )
