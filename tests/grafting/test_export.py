import pytest
import torch
from torch import nn

from pcsr.contracts import Fusion, Widths
from tests.grafting.networks import CASES


class Weighing(Fusion):
    """Features that weigh the touched ones; rows without touches get no number at all, as in attention."""

    def __init__(self, widths):
        super().__init__()
        self.query, self.value = nn.Linear(widths.visual, widths.touch), nn.Linear(widths.touch, widths.visual)

    def forward(self, points, features, touches):
        match = self.query(features) @ touches.flat.transpose(1, 2)
        match = match.masked_fill(touches.flat_padding[:, None], -torch.inf)
        return features + match.softmax(-1) @ self.value(touches.flat)


@pytest.mark.slow
def test_an_exported_graft_gives_the_same_for_any_batch(world):
    points, touches = world
    case = CASES["pu-net"]
    grafted = case.graft(fusion=Weighing(Widths(visual=32, touch=8)), touch_encoder={"use": "unet", "channels": 8})
    mask = torch.tensor([[True, True], [False, False], [True, False]])
    args, kwargs = (points.transpose(1, 2), 4), {"touches": touches, "mask": mask}
    batch = torch.export.Dim("batch", min=2, max=64)
    shapes = {"args": ({0: batch}, None), "touches": {0: batch}, "mask": {0: batch}}
    program = torch.export.export(grafted, args, kwargs, dynamic_shapes=shapes).module()
    order = [2, 0, 1, 1, 2]
    touched = {"touches": touches[order], "mask": mask[order]}
    given = case.call(program, points[order], **touched)
    torch.testing.assert_close(given, case.call(grafted, points[order], **touched), atol=1e-5, rtol=0)
    torch.testing.assert_close(given[2], case.call(grafted, points[order])[2], atol=1e-5, rtol=0)
    assert (given[1] - case.call(grafted, points[order])[1]).abs().max() > 1e-3


def test_the_default_fusion_is_exported(world):
    points, touches = world
    grafted = CASES["edge-conv"].graft(touch_encoder=None)
    mask = torch.tensor([[True, True], [False, False], [True, False]])
    program = torch.export.export(grafted, (), {"cloud": points, "touches": touches, "mask": mask}).module()
    given, wanted = program(cloud=points, touches=touches, mask=mask), grafted(cloud=points, touches=touches, mask=mask)
    torch.testing.assert_close(given["dense"], wanted["dense"], atol=1e-5, rtol=0)


@pytest.mark.slow
@pytest.mark.parametrize("fusion", ["iterative", "concat"])
def test_fusions_that_pair_points_are_exported_for_any_batch(world, fusion):
    points, touches = world
    case = CASES["pu-net"]
    grafted = case.graft(fusion=fusion)
    mask = torch.tensor([[True, True], [False, True], [True, False]])
    batch = torch.export.Dim("batch", min=2, max=64)
    shapes = {"args": ({0: batch}, None), "touches": {0: batch}, "mask": {0: batch}}
    args, kwargs = (points.transpose(1, 2), 4), {"touches": touches, "mask": mask}
    program = torch.export.export(grafted, args, kwargs, dynamic_shapes=shapes).module()
    for order in ([0, 1, 2], [2, 0, 1, 1, 2], [1, 0]):
        touched = {"touches": touches[order], "mask": mask[order]}
        given = case.call(program, points[order], **touched)
        assert torch.equal(given, case.call(grafted, points[order], **touched))
        assert not torch.equal(given, case.call(grafted, points[order]))
    # A row without touches is left out of an eager fusion: a smaller batch, which may be rounded otherwise.
    mask = torch.tensor([[True, True], [False, False], [True, False]])
    given, wanted = (case.call(net, points, touches=touches, mask=mask) for net in (program, grafted))
    torch.testing.assert_close(given, wanted, atol=1e-6, rtol=0)
    torch.testing.assert_close(given[1], case.call(grafted, points)[1], atol=1e-6, rtol=0)
