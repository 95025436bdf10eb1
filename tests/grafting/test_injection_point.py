import pytest
import torch
from torch import nn

from pcsr.contracts import TouchBatch
from pcsr.errors import UserError
from pcsr.grafting import graft
from pcsr.network.network import fuse
from tests.grafting.networks import CASES, PLUGINS, Layers, Meeting, N, Second


@torch.no_grad()
def test_the_fused_features_are_those_of_the_hosts_own_fuse(world):
    """Against the layers called by hand, so that no transposition goes unseen."""
    points, touches = world
    case = CASES["pu-net"]
    grafted = case.graft()
    net = grafted.network
    visual = net.mlp2(net.mlp1(points.transpose(1, 2).unsqueeze(-1)))[..., 0].transpose(1, 2)
    fused = fuse(grafted.fusion, grafted.touch_encoder, points, visual, TouchBatch.of(touches))
    offsets = [net.coordinates(net.expand[i](fused.transpose(1, 2)[..., None]))[..., 0] for i in range(4)]
    expected = torch.cat([points + offset.transpose(1, 2) for offset in offsets], 1)
    torch.testing.assert_close(case.call(grafted, points, touches=touches), expected)


@torch.no_grad()
def test_the_points_are_those_that_entered_even_if_the_network_moves_them(world, monkeypatch):
    points, touches = world
    messages = []
    grafted = CASES["transformer"].graft()
    grafted.fusion.register_forward_hook(lambda fusion, args, output: messages.append(args[0]))
    grafted(points + 5, touches=touches + 5)
    assert torch.equal(messages[0], points + 5)


@torch.no_grad()
def test_points_may_be_any_argument(world):
    points, touches = world
    grafted = graft(Second(), "layer", points=1, arguments=(2.0,), registry=PLUGINS)
    first = graft(Meeting(None), "layer", registry=PLUGINS)
    first.load_state_dict(grafted.state_dict())
    assert torch.equal(grafted(2.0, points, touches=touches), 2 * first(points, touches=touches))


def test_channels_behind_the_coordinates_are_allowed_where_stated(world):
    points, touches = world
    network = nn.Sequential(nn.Linear(6, 8), nn.Linear(8, 3))
    grafted = graft(network, "0", probe=torch.rand(1, 5, 6), points_layout="bnc", fusion="concat", registry=PLUGINS)
    normals = torch.randn(3, N, 3)
    messages = []
    grafted.fusion.register_forward_hook(lambda fusion, args, output: messages.append(args[0]))
    assert grafted(torch.cat([points, normals], -1), touches=touches).shape == (3, N, 3)
    assert torch.equal(messages[0], points)


def test_points_that_are_not_where_the_probe_had_them_are_refused(world):
    points, touches = world
    grafted = CASES["pu-net"].graft()
    with pytest.raises(UserError, match=r"argument 0 of the network, which got 0 by position and xyz, rate by keyword"):
        grafted(xyz=points.transpose(1, 2), rate=4, touches=touches)
    with pytest.raises(UserError, match=r"argument 0 of the network, are \(3, 2, 24\), not \(b 3 n\)"):
        grafted(points[..., :2].transpose(1, 2), 4, touches=touches)
    with pytest.raises(UserError, match=r"argument 0 of the network, are list, not"):
        grafted([1], 4, touches=touches)
    with pytest.raises(UserError, match=r"argument 0 of the network, are \(3, 24, 3\), not \(b 3 n\)"):
        grafted(points, 4, touches=touches)


def test_a_layer_that_a_pass_leaves_out_or_thins_is_named(world):
    points, touches = world
    with pytest.raises(UserError, match=r"layer 'inner\.lift' was not called in this pass"):
        graft(Layers(), "inner.lift", registry=PLUGINS)(points, skip=True, touches=touches)

    class Moody(Meeting):
        def forward(self, points, step=1, times=1):
            for _ in range(times):
                features = self.layer(points[:, ::step])
            return self.head(features)

    grafted = graft(Moody(None), "layer", registry=PLUGINS)
    with pytest.raises(UserError, match=r"layer 'layer' gives \(3, 12, 8\) for 3 × 24 points, not one feature of 8"):
        grafted(points, 2, touches=touches)
    with pytest.raises(UserError, match=r"layer 'layer' was called again within one pass"):
        grafted(points, times=2, touches=touches)
    assert torch.equal(grafted(points, times=2), grafted(points))
