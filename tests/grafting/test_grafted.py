"""What a graft changes, what it leaves alone, and what a call must bring."""

import copy

import pytest
import torch

from pcsr.contracts import Widths
from pcsr.errors import UserError
from pcsr.grafting import graft
from pcsr.metrics.chamfer import chamfer
from tests.grafting.networks import CASES, PLUGINS, Bias, Layers, Meeting, N, same


@torch.no_grad()
def test_zero_touches_are_the_network_alone_bit_for_bit(case, world):
    points, touches = world
    grafted = case.graft()
    alone = case.call(case.make(), points)
    none = torch.zeros(3, 2, dtype=torch.bool)
    for touch in ({}, {"touches": None}, {"touches": touches[:, :0]}, {"touches": touches, "mask": none}):
        assert torch.equal(case.call(grafted, points, **touch), alone)
    assert case.call(grafted, points, touches=touches).shape == alone.shape
    assert not torch.equal(case.call(grafted, points, touches=touches), alone)
    assert torch.equal(case.call(grafted.network, points), alone)  # no hook stays behind


@torch.no_grad()
def test_everything_else_is_handed_through(world):
    points, touches = world
    edge, pu = CASES["edge-conv"].graft(), CASES["pu-net"].graft()
    assert edge(cloud=points, touches=touches, flag="kept")["flag"] == "kept"
    assert pu(points.transpose(1, 2), 2, touches=touches).shape == (3, 3, 2 * N)
    assert pu(points.transpose(1, 2), rate=3).shape == (3, 3, 3 * N)


@pytest.mark.parametrize("fusion", ["iterative", "concat"])
@torch.no_grad()
def test_rows_of_a_mixed_batch_are_the_rows_alone(case, world, fusion):
    points, touches = world
    grafted = case.graft(fusion=fusion)
    mask = torch.tensor([[True, True], [False, False], [True, False]])
    mixed = case.call(grafted, points, touches=touches, mask=mask)
    for row, count in enumerate((2, 0, 1)):
        one = slice(row, row + 1)
        touched = {"touches": touches[one, :count]} if count else {}
        torch.testing.assert_close(mixed[one], case.call(grafted, points[one], **touched), atol=1e-5, rtol=0)


def test_gradients_reach_the_tactile_parts_and_the_network(case, world):
    points, touches = world
    grafted = case.graft()
    (case.call(grafted, points, touches=touches) ** 2).sum().backward()
    for name, weight in [*grafted.fusion.named_parameters(), *grafted.touch_encoder.named_parameters()]:
        assert weight.grad is not None, name
        assert weight.grad.isfinite().all(), name
        assert weight.grad.abs().max() > 0, name
    assert any(weight.grad is not None and weight.grad.abs().max() > 0 for weight in grafted.network.parameters())


def test_training_the_tactile_parts_alone_lowers_the_loss(case, world):
    points, touches = world
    grafted = case.graft()
    before = copy.deepcopy(grafted.network.state_dict())
    truth = torch.cat([points, touches.flatten(1, 2)], 1)
    optimizer = torch.optim.Adam(grafted.tactile_parameters(), lr=3e-3)
    losses = []
    for _ in range(20):
        optimizer.zero_grad()
        loss = chamfer(case.call(grafted, points, touches=touches), truth).mean()
        loss.backward()
        optimizer.step()
        losses.append(float(loss.detach()))
    assert losses[-1] < 0.9 * losses[0]
    assert same(before.values(), grafted.network.state_dict().values())


def test_the_tactile_parameters_are_those_that_the_network_lacks(case):
    grafted = case.graft()
    theirs = {id(p) for p in grafted.network.parameters()}
    tactile = list(grafted.tactile_parameters())
    assert len(tactile) == len(list(grafted.fusion.parameters())) + len(list(grafted.touch_encoder.parameters()))
    assert not theirs & {id(p) for p in tactile}
    assert len(theirs) + len(tactile) == len(list(grafted.parameters()))


@torch.no_grad()
def test_a_copy_is_of_its_own(case, world):
    points, touches = world
    grafted = case.graft()
    before = case.call(grafted, points, touches=touches)
    other = copy.deepcopy(grafted)
    assert torch.equal(case.call(other, points, touches=touches), before)
    for weight in other.parameters():
        weight.mul_(0.5)
    assert torch.equal(case.call(grafted, points, touches=touches), before)
    assert not torch.equal(case.call(other, points, touches=touches), before)
    other.load_state_dict(grafted.state_dict())
    assert torch.equal(case.call(other, points, touches=touches), before)


def test_modes_and_types_go_to_every_part(case, world):
    points, touches = world
    assert not case.graft().fusion.training
    assert case.graft(case.make().train()).touch_encoder.training
    grafted = case.graft().train()
    assert grafted.fusion.training
    assert not any(module.training for module in grafted.network.modules())
    grafted.frozen = False
    assert grafted.train().network.training
    assert not grafted.eval().touch_encoder.training
    dense = case.call(grafted.double(), points.double(), touches=touches.double())
    assert dense.dtype == torch.float64
    assert {p.dtype for p in case.graft(case.make().double()).parameters()} == {torch.float64}


@torch.no_grad()
def test_under_autocast_the_code_behind_the_layer_gets_the_type_that_it_knows(world):
    points, touches = world
    grafted, seen = graft(Meeting(None), "layer", fusion=Bias(Widths()), registry=PLUGINS), []
    grafted.network.head.register_forward_hook(lambda head, args, output: seen.append(args[0].dtype))
    with torch.autocast("cpu", torch.bfloat16):
        assert not torch.equal(grafted(points, touches=touches), grafted(points))
    assert seen == [torch.bfloat16] * 2


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: {"touches": t[0]}, r"touches are \(2, 10, 3\), not \(b a m 3\) with b = 3"),
        (lambda t: {"touches": t[:2]}, r"touches are \(2, 2, 10, 3\), not \(b a m 3\) with b = 3"),
        (lambda t: {"touches": t.transpose(2, 3)}, r"touches are \(3, 2, 3, 10\), not"),
        (lambda t: {"touches": t[:, :, :0]}, r"touches are \(3, 2, 0, 3\), not .* at least 1"),
        (lambda t: {"touches": t.double()}, r"touches are torch\.float64 on cpu, the points torch\.float32 on cpu"),
        (lambda t: {"touches": t.to("meta")}, r"touches are torch\.float32 on meta, the points"),
        (
            lambda t: {"touches": t, "mask": torch.ones(3, 2)},
            r"mask is torch\.float32 \(3, 2\) on cpu, not torch\.bool \(3, 2\) on",
        ),
        (
            lambda t: {"touches": t, "mask": torch.ones(3, 2, dtype=torch.bool, device="meta")},
            r"mask is .* on meta, not",
        ),
        (lambda t: {"touches": t, "mask": torch.ones(3, 1, dtype=torch.bool)}, r"mask is torch\.bool \(3, 1\) on"),
        (lambda t: {"mask": torch.ones(3, 2, dtype=torch.bool)}, "there are no touches: leave it out"),
    ],
)
def test_touches_that_do_not_fit_the_points_are_refused(world, change, message):
    points, touches = world
    with pytest.raises(UserError, match=message):
        graft(Meeting(None), "layer", registry=PLUGINS)(points, **change(touches))


@torch.no_grad()
def test_touches_in_another_unit_are_refused_with_both_sizes(world):
    points, touches = world
    points = points - points.mean(1, keepdim=True)
    points = points / points.norm(dim=-1).amax(1)[:, None, None]
    grafted = graft(Meeting(None), "layer", registry=PLUGINS)
    far = touches - touches.mean(2, keepdim=True) + torch.tensor([10.5, 0, 0])
    mixed = torch.cat([touches[:1], far[1:]])
    with pytest.raises(
        UserError, match=r"row 1 of the batch: .* lies 10\.5 away from the centre of its cloud, which is 2 across:"
    ):
        grafted(points, touches=mixed)
    part = touches.clone()
    part[1, 0, 2] = torch.inf  # of one point, beside another touch that is whole
    for spoilt, row in ((touches * torch.nan, 0), (part, 1)):
        with pytest.raises(UserError, match=f"row {row} of the batch: a touch has coordinates that are not finite"):
            grafted(points, touches=spoilt)
    present = torch.ones(touches.shape[:2], dtype=torch.bool)
    present[1, 0] = False
    assert grafted(points, touches=part, mask=present).isfinite().all()
    grafted(points, touches=far - torch.tensor([0.6, 0, 0]))  # within ten radii
    grafted(points, touches=torch.stack([touches[:, 0], far[:, 0]], 1))  # one of two is near
    grafted(points, touches=mixed, mask=torch.tensor([[True, True], [False, False], [False, False]]))
    with pytest.raises(UserError, match="row 0"):
        grafted(points, touches=torch.stack([touches[:, 0], far[:, 0]], 1), mask=torch.tensor([[False, True]] * 3))


def test_a_layer_without_gradients_is_refused_unless_nobody_wants_any(world):
    points, touches = world
    grafted = graft(Layers(), "frozen", registry=PLUGINS)
    with pytest.raises(UserError, match=r"layer 'frozen' runs without gradients"):
        grafted(points, touches=touches)
    with torch.no_grad():
        grafted(points, touches=touches)
    grafted.requires_grad_(False)(points, touches=touches)
