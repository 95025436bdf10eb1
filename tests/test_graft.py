"""Touch on networks in other people's styles: what a graft changes, what it leaves alone, what it refuses."""

import contextlib
import copy
import json
import re
import threading
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import torch
from safetensors.torch import save_file
from torch import nn

from pcsr.checkpoint import read_card
from pcsr.contracts import Fusion, Widths
from pcsr.errors import UserError
from pcsr.graft import Grafted, _part, graft, load_graft, save_graft
from pcsr.metrics.chamfer import chamfer
from pcsr.model import fuse
from pcsr.plugins import load_plugins
from pcsr_plugins.encoders.mlp import Mlp
from pcsr_plugins.fusions.concat import Concat

N = 24
PLUGINS = load_plugins()
DOCUMENT = Path(__file__).parents[1] / "docs" / "graft.md"


class PUNetLike(nn.Module):
    """(b 3 n) through 2D convolutions, (b c n 1) in between, to (b 3 rn)."""

    def __init__(self):
        super().__init__()
        self.mlp1 = nn.Sequential(nn.Conv2d(3, 16, 1), nn.BatchNorm2d(16), nn.ReLU(inplace=True))
        self.mlp2 = nn.Sequential(nn.Conv2d(16, 32, 1), nn.ReLU(inplace=True))
        self.expand = nn.ModuleList([nn.Conv2d(32, 16, 1) for _ in range(4)])
        self.coordinates = nn.Sequential(nn.ReLU(inplace=True), nn.Conv2d(16, 3, 1))

    def forward(self, xyz, rate):
        features = self.mlp2(self.mlp1(xyz.unsqueeze(-1)))
        features = features.view(xyz.shape[0], -1).view(xyz.shape[0], 32, -1, 1)  # goes with contiguous ones only
        offsets = [self.coordinates(self.expand[i](features)).squeeze(-1) for i in range(rate)]
        return torch.cat([xyz + offset for offset in offsets], dim=2)


class TransformerLike(nn.Module):
    """(b n 3) through a transformer to a coarse and a fine cloud; it centres its input in place."""

    def __init__(self):
        super().__init__()
        self.embed = nn.Linear(3, 16)
        layer = nn.TransformerEncoderLayer(16, 2, 32, dropout=0.1, batch_first=True)
        self.body = nn.TransformerEncoder(layer, 2, enable_nested_tensor=False)
        self.coarse, self.fine = nn.Linear(16, 3), nn.Linear(16, 6)

    def forward(self, points):
        middle = points.mean(1, keepdim=True)
        points -= middle
        features = self.body(self.embed(points))
        coarse = points + self.coarse(features)
        fine = coarse.repeat_interleave(2, 1) + self.fine(features).view(points.shape[0], -1, 3)
        return coarse + middle, fine + middle


class EdgeConvLike(nn.Module):
    """Keywords only, neighbours by distance, 1D convolutions, (b c n) in between, to a dictionary."""

    def __init__(self):
        super().__init__()
        self.edge = nn.Conv2d(6, 16, 1)
        self.point = nn.Conv1d(16, 24, 1)
        self.head = nn.Conv1d(24, 6, 1)

    def forward(self, *, cloud, k=4, flag=False):
        b, n, _ = cloud.shape
        near = torch.cdist(cloud, cloud).topk(k, largest=False).indices
        neighbours = cloud.gather(1, near.flatten(1)[..., None].expand(-1, -1, 3)).view(b, n, k, 3)
        edges = torch.cat([neighbours - cloud[:, :, None], cloud[:, :, None].expand(-1, -1, k, -1)], -1)
        features = self.edge(edges.permute(0, 3, 1, 2)).amax(-1)
        offsets = self.head(self.point(features).relu()).view(b, 2, 3, n)
        return {"dense": (cloud.transpose(1, 2)[:, None] + offsets).permute(0, 3, 1, 2).flatten(1, 2), "flag": flag}


@dataclass
class Case:
    network: type[nn.Module]
    at: str
    layout: str
    width: int
    call: Any
    options: dict[str, Any] = field(default_factory=dict)

    def make(self, seed=0):
        torch.manual_seed(seed)
        return self.network().eval()

    def graft(self, network=None, **options):
        return graft(network or self.make(), self.at, **({"registry": PLUGINS} | self.options | options))


CASES = {
    "pu-net": Case(
        PUNetLike,
        "mlp2",
        "bcn1",
        32,
        lambda net, x, **touch: net(x.transpose(1, 2), 4, **touch).transpose(1, 2),
        {"probe": (1, 3, 32), "arguments": (4,)},
    ),
    "transformer": Case(
        TransformerLike, "body", "bnc", 16, lambda net, x, **touch: net(x.clone(), **touch)[1], {"probe": (1, 32, 3)}
    ),
    "edge-conv": Case(
        EdgeConvLike,
        "point",
        "bcn",
        24,
        lambda net, x, **touch: net(cloud=x, flag=True, **touch)["dense"],
        {"probe": (1, 32, 3), "points": "cloud", "keywords": {"k": 4}},
    ),
}


@pytest.fixture(autouse=True, scope="module")
def one_thread():
    """Networks this small only lose by more."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture(params=CASES)
def case(request):
    return CASES[request.param]


@pytest.fixture
def world():
    """Three clouds, up to two touches of ten points each."""
    random = torch.Generator().manual_seed(1)
    return torch.rand(3, N, 3, generator=random) - 0.5, (torch.rand(3, 2, 10, 3, generator=random) - 0.5) / 2


def same(first, second):
    return all(torch.equal(a, b) for a, b in zip(first, second, strict=True))


# What a graft does


def test_the_probe_finds_layout_and_width(case):
    joint = case.graft().joint
    assert (joint.at, joint.layout, joint.width) == (case.at, case.layout, case.width)


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
        felt = {"touches": touches[one, :count]} if count else {}
        torch.testing.assert_close(mixed[one], case.call(grafted, points[one], **felt), atol=1e-5, rtol=0)


@torch.no_grad()
def test_the_fused_features_are_those_of_the_hosts_own_fuse(world):
    """Against the layers called by hand, so that no transposition goes unseen."""
    points, touches = world
    case = CASES["pu-net"]
    grafted = case.graft()
    net = grafted.network
    visual = net.mlp2(net.mlp1(points.transpose(1, 2).unsqueeze(-1)))[..., 0].transpose(1, 2)
    fused = fuse(grafted.fusion, grafted.touch_encoder, points, visual, touches, torch.ones(3, 2, dtype=torch.bool))
    offsets = [net.coordinates(net.expand[i](fused.transpose(1, 2)[..., None]))[..., 0] for i in range(4)]
    expected = torch.cat([points + offset.transpose(1, 2) for offset in offsets], 1)
    torch.testing.assert_close(case.call(grafted, points, touches=touches), expected)


@torch.no_grad()
def test_the_points_are_those_that_entered_even_if_the_network_moves_them(world, monkeypatch):
    points, touches = world
    heard = []
    grafted = CASES["transformer"].graft()
    grafted.fusion.register_forward_hook(lambda fusion, args, output: heard.append(args[0]))
    grafted(points + 5, touches=touches + 5)
    assert torch.equal(heard[0], points + 5)


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


@torch.no_grad()
def test_a_saved_graft_comes_back_on_a_fresh_network(case, world, tmp_path):
    points, touches = world
    grafted = case.graft(fusion={"use": "concat", "touches": 3}, touch_encoder={"use": "mlp", "channels": 5})
    save_graft(tmp_path / "graft.safetensors", grafted, {"epoch": 3})
    loaded = load_graft(tmp_path / "graft.safetensors", case.make(seed=1), PLUGINS)
    for touch in ({}, {"touches": touches}):
        assert torch.equal(case.call(loaded, points, **touch), case.call(grafted, points, **touch))
    assert (loaded.joint, loaded.specs, loaded.training) == (grafted.joint, grafted.specs, False)
    assert read_card(tmp_path / "graft.safetensors")["about"] == {"epoch": 3}
    assert [path.name for path in tmp_path.iterdir()] == ["graft.safetensors"]


def test_modes_and_types_go_to_every_part(case, world):
    points, touches = world
    assert not case.graft().fusion.training
    assert case.graft(case.make().train()).touch_encoder.training
    grafted = case.graft().train()
    assert grafted.network.training
    assert grafted.fusion.training
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


def test_the_probe_leaves_the_network_and_the_random_state_alone(case):
    network = case.make()
    network.train()
    *_, inner = network.children()
    inner.eval()
    weights, state = copy.deepcopy(network.state_dict()), torch.get_rng_state()
    case.graft(network, fusion=Bias(Widths()), touch_encoder=None)
    assert torch.equal(torch.get_rng_state(), state)
    assert network.training
    assert not inner.training
    assert same(weights.values(), network.state_dict().values())
    assert not any(module._forward_hooks for module in network.modules())


class Particular(nn.Module):
    """It draws at random even in `eval` mode, and takes no point twice."""

    def __init__(self):
        super().__init__()
        self.layer = nn.Linear(3, 8)

    def forward(self, points):
        if len(points[0].unique(dim=0)) < points.shape[1]:
            raise ValueError("the same point twice")
        return self.layer(points + torch.rand(1))


def test_a_network_that_draws_at_random_is_probed_without_a_trace():
    network = Particular()
    state = torch.get_rng_state()
    graft(network, "layer", fusion=Bias(Widths()), touch_encoder=None, registry=PLUGINS)
    assert torch.equal(torch.get_rng_state(), state)


@torch.no_grad()
def test_without_touches_there_is_no_hook(world):
    """Some of torch's layers compute otherwise where a hook is: then nothing would be bit for bit the same."""
    points, touches = world

    class Watched(Meeting):
        def forward(self, points):
            hooks.append(len(self.layer._forward_hooks))
            return super().forward(points)

    hooks = []
    grafted = graft(Watched(None), "layer", registry=PLUGINS)
    hooks.clear()
    none = torch.zeros(3, 2, dtype=torch.bool)
    for touch in ({}, {"touches": touches[:, :0]}, {"touches": touches, "mask": none}, {"touches": touches}):
        grafted(points, **touch)
    assert hooks == [0, 0, 0, 1]


@torch.no_grad()
def test_the_touches_do_not_outlive_a_forward_that_fails(world, monkeypatch):
    points, touches = world
    case = CASES["pu-net"]
    grafted = case.graft()
    alone = case.call(grafted, points)
    with pytest.raises(IndexError):
        grafted(points.transpose(1, 2), 9, touches=touches)  # it knows four at most, and notices behind the layer
    assert not grafted.network.mlp2._forward_hooks
    assert torch.equal(case.call(grafted, points), alone)
    assert torch.equal(case.call(grafted.network, points), alone)


class Meeting(nn.Module):
    """Waits behind its entrance until another thread is there too."""

    def __init__(self, barrier):
        super().__init__()
        self.barrier, self.layer, self.head = barrier, nn.Linear(3, 8), nn.Linear(8, 3)

    def forward(self, points):
        if self.barrier is not None:
            self.barrier.wait(10)
        features = self.layer(points)
        if self.barrier is not None:
            self.barrier.wait(10)
        return self.head(features)


def test_threads_do_not_hear_each_others_touches(world):
    points, touches = world
    grafted = graft(Meeting(None), "layer", registry=PLUGINS).requires_grad_(False)
    # A shallow copy, as nn.DataParallel makes them: its own module, the same dictionary of hooks.
    replica = grafted._replicate_for_data_parallel()
    replica.network = grafted.network._replicate_for_data_parallel()
    for module in (replica, replica.network):
        module._modules = dict(module._modules)
    replica.network.layer = grafted.network.layer._replicate_for_data_parallel()
    replica.network.layer.weight, replica.network.layer.bias = grafted.network.layer.weight, grafted.network.layer.bias
    assert replica.network.layer._forward_hooks is grafted.network.layer._forward_hooks
    calls = [(grafted, touches), (replica, -touches), (grafted, touches[:, :1]), (grafted, None)]
    expected = [grafted(points, touches=touch) for _, touch in calls]
    grafted.network.barrier = replica.network.barrier = threading.Barrier(len(calls))
    results = [None] * len(calls)

    def work(index):
        results[index] = calls[index][0](points, touches=calls[index][1])

    threads = [threading.Thread(target=work, args=(index,)) for index in range(len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(20)
    for result, wanted in zip(results, expected, strict=True):
        torch.testing.assert_close(result, wanted, atol=1e-6, rtol=0)
    assert not torch.equal(expected[0], expected[1])


@torch.no_grad()
def test_two_grafts_share_a_network_without_hearing_each_other(world):
    points, touches = world
    network = Meeting(None)
    first, second = graft(network, "layer", registry=PLUGINS), graft(network, "head", registry=PLUGINS)
    before = first(points, touches=touches), second(points, touches=touches)
    assert same(before, (first(points, touches=touches), second(points, touches=touches)))
    assert not torch.equal(*before)


@torch.no_grad()
def test_a_graft_on_a_graft_hears_touch_at_both_layers(world, tmp_path):
    points, touches = world
    inner = graft(Meeting(None), "layer", registry=PLUGINS)
    outer = graft(inner, "network.head", fusion="concat", registry=PLUGINS)
    fused = []
    for part in (inner.fusion, outer.fusion):
        part.register_forward_hook(lambda part, args, output: fused.append(type(part).__name__))
    both = outer(points, touches=touches)
    assert fused == ["Iterative", "Concat"]
    assert torch.equal(outer(points), inner.network(points))
    assert len(list(outer.tactile_parameters())) == len(list(outer.parameters())) - 4
    save_graft(tmp_path / "two", outer)
    loaded = load_graft(tmp_path / "two", graft(Meeting(None), "layer", registry=PLUGINS), PLUGINS)
    assert torch.equal(loaded(points, touches=touches), both)


class Weighing(Fusion):
    """Features that weigh the touched ones; rows without touches get no number at all, as in attention."""

    def __init__(self, widths):
        super().__init__()
        self.query, self.value = nn.Linear(widths.visual, widths.touch), nn.Linear(widths.touch, widths.visual)

    def forward(self, points, features, touches):
        match = self.query(features) @ touches.flat.transpose(1, 2)
        match = match.masked_fill(touches.flat_padding[:, None], -torch.inf)
        return features + match.softmax(-1) @ self.value(touches.flat)


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
    felt = {"touches": touches[order], "mask": mask[order]}
    given = case.call(program, points[order], **felt)
    torch.testing.assert_close(given, case.call(grafted, points[order], **felt), atol=1e-5, rtol=0)
    torch.testing.assert_close(given[2], case.call(grafted, points[order])[2], atol=1e-5, rtol=0)
    assert (given[1] - case.call(grafted, points[order])[1]).abs().max() > 1e-3


def test_the_default_fusion_is_exported(world):
    points, touches = world
    grafted = CASES["edge-conv"].graft(touch_encoder=None)
    mask = torch.tensor([[True, True], [False, False], [True, False]])
    program = torch.export.export(grafted, (), {"cloud": points, "touches": touches, "mask": mask}).module()
    given, wanted = program(cloud=points, touches=touches, mask=mask), grafted(cloud=points, touches=touches, mask=mask)
    torch.testing.assert_close(given["dense"], wanted["dense"], atol=1e-5, rtol=0)


# Parts


class Bias(Fusion):
    """A fusion without weights: adds the mean of the touched coordinates to every channel."""

    def __init__(self, widths, times=1):
        super().__init__()
        self.times = times

    def forward(self, points, features, touches):
        return features.repeat(1, 1, self.times) + touches.flat_points.mean((1, 2), keepdim=True)


def test_parts_are_taken_by_name_by_options_and_as_they_are(world):
    points, touches = world
    network = Meeting(None)
    encoder = Mlp(Widths(), channels=6)
    for fusion, touch_encoder in [
        ("iterative", "mlp"),
        ({"use": "iterative", "pool": "global"}, {"use": "unet", "channels": 4}),
        (Concat(Widths(visual=8, touch=6)), encoder),
        ("concat", None),
    ]:
        grafted = graft(network, "layer", fusion=fusion, touch_encoder=touch_encoder, registry=PLUGINS)
        assert not torch.equal(grafted(points, touches=touches), network(points))
    assert graft(network, "layer", touch_encoder=encoder, registry=PLUGINS).touch_encoder is encoder


def test_installed_plugins_are_found_without_a_registry():
    assert graft(Meeting(None), "layer").specs["fusion"] == {"use": "iterative", "pool": "none"}


@pytest.mark.parametrize(("width", "channels"), [(8, 8), (32, 8), (128, 32), (150, 38)])
def test_the_default_touch_encoder_is_a_unet_of_a_quarter_of_the_width(width, channels):
    network = nn.Sequential(nn.Linear(3, width), nn.Linear(width, 3))
    spec = graft(network, "0", registry=PLUGINS).specs["touch_encoder"]
    assert spec == {"use": "unet", "channels": channels, "order": "hilbert"}


class JoinsToo(Bias):
    def join(self, points, touches, mask):
        return points


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fusion": "iterativ"}, r"there is no fusion 'iterativ': did you mean 'iterative'\?"),
        ({"fusion": {"use": "iterative", "pol": "none"}}, r"fusion 'iterative' takes no 'pol': did you mean 'pool'\?"),
        ({"fusion": {"use": "iterative", "pool": "max"}}, r"fusion 'iterative'\.pool: input should be .*got 'max'"),
        ({"fusion": {"use": "concat", "touches": "two"}}, r"fusion 'concat'\.touches: .*integer, got 'two'"),
        ({"fusion": {"pool": "none"}}, r"fusion \{'pool': 'none'\}: give a name"),
        ({"touch_encoder": {"use": "unet", "channels": {1}}}, "encoder 'unet': options are what JSON can write"),
        ({"touch_encoder": {"use": "unet", "channels": -8}}, r"encoder 'unet' cannot be built with .*-8"),
        ({"fusion": "none"}, "fusion 'none' joins touched points.*cannot tell which outputs"),
        ({"fusion": JoinsToo(Widths())}, "fusion 'JoinsToo' joins touched points"),
        (
            {"fusion": Concat(Widths(visual=9, touch=8))},
            "Concat does not fit layer 'layer' of 8 channels.*RuntimeError",
        ),
        ({"fusion": Bias(Widths(), 2)}, "Bias does not fit layer 'layer' of 8 channels"),
        ({"layout": "bnd"}, r"layout='bnd' is unknown: did you mean 'bnc'\?"),
        ({"points_layout": "bcn1"}, r"points_layout='bcn1' is unknown: did you mean 'bcn'\?"),
    ],
)
def test_a_mistake_in_the_parts_is_one_line(options, message):
    with pytest.raises(UserError, match=message) as caught:
        graft(Meeting(None), "layer", **({"registry": PLUGINS} | options))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("kind", "given", "message"),
    [
        ("fusion", None, "fusion None: give a name, .* or a pcsr.Fusion"),
        ("fusion", Mlp(Widths()), r"(?s)fusion Mlp.*: give a name"),
        ("encoder", 32, "encoder 32: give a name, .* or a pcsr.Encoder"),
    ],
)
def test_what_is_no_part_at_all_is_refused(kind, given, message):
    with pytest.raises(UserError, match=message) as caught:
        _part(kind, given, Widths(), PLUGINS)
    assert "\n" not in str(caught.value)


# What a layer must give


class Layers(nn.Module):
    """One layer for each thing that a layer can give."""

    def __init__(self):
        super().__init__()
        self.lift, self.again, self.never = nn.Linear(3, 8), nn.Linear(8, 8), nn.Linear(8, 8)
        self.sampled, self.pooled, self.square, self.flat = (nn.Identity() for _ in range(4))
        self.edges, self.growing, self.merged, self.frozen = *(nn.Identity() for _ in range(3)), nn.Linear(8, 8)
        self.pair = nn.GRU(8, 8, batch_first=True)
        self.inner = nn.ModuleDict({"lift": nn.Linear(8, 8)})

    def forward(self, points, skip=False, fail=False):
        x = self.lift(points)
        x = self.again(self.again(self.again(x)))
        self.sampled(x[:, ::2]), self.pooled(x.amax(1)), self.square(x @ x.transpose(1, 2)), self.flat(x.flatten(0, 1))
        self.edges(x.transpose(1, 2)[..., None].expand(-1, -1, -1, 4)), self.growing(x.repeat(1, 1, x.shape[1]))
        self.pair(x), self.merged(x.flatten(0, 1)[None])
        with torch.no_grad():
            x = x + self.frozen(x)
        if fail:
            raise ValueError("a slip\nof theirs")
        return x if skip else self.inner["lift"](x)


@pytest.mark.parametrize(
    ("at", "message"),
    [
        ("lift2", r"Layers has no layer 'lift2': did you mean 'lift'\?"),
        ("encoder.lift", r"no layer 'encoder\.lift': did you mean 'lift' or 'inner\.lift'\?"),
        ("", "no layer '': it has lift, again, never, sampled, pooled, square, flat, edges …"),
        ("never", "layer 'never' is called 0 times"),
        ("again", "layer 'again' is called 3 times"),
        ("pair", "layer 'pair' gives a tuple, not a tensor"),
        ("sampled", r"gives \(2, 128, 8\) for 256 points and \(2, 256, 8\) for 512: .*as behind a sampling"),
        ("merged", r"gives \(1, 512, 8\) for 256 points and \(1, 1024, 8\) for 512: not as many points"),
        ("pooled", r"gives \(2, 8\) for 256 points and \(2, 8\) for 512: not one feature for each point"),
        ("flat", r"gives \(512, 8\) for 256 points and \(1024, 8\) for 512: not one feature for each point"),
        ("edges", r"gives \(2, 8, 256, 4\) .*: not one feature for each point"),
        ("square", r"gives \(2, 256, 256\) .*: its width cannot be told"),
        ("growing", r"gives \(2, 256, 2048\) .*: its width cannot be told"),
    ],
)
def test_a_layer_that_does_not_give_a_feature_for_each_point_is_refused(at, message):
    with pytest.raises(UserError, match=message) as caught:
        graft(Layers(), at, probe=(1, 256, 3), registry=PLUGINS)
    assert "\n" not in str(caught.value)


def test_of_a_layer_that_gives_no_tensor_the_ones_inside_are_offered():
    network = nn.Sequential(nn.Linear(3, 8), Pair(), First(), nn.Linear(8, 3))
    with pytest.raises(UserError, match=r"layer '1' gives a tuple, not a tensor: graft at a layer .* '1\.one'"):
        graft(network, "1", registry=PLUGINS)
    assert graft(network, "1.one", registry=PLUGINS).joint.width == 8


class Pair(nn.Module):
    def __init__(self):
        super().__init__()
        self.one = nn.Linear(8, 8)

    def forward(self, x):
        return self.one(x), x


class First(nn.Module):
    def forward(self, pair):
        return pair[0]


def test_a_stated_layout_needs_one_number_of_points_only(world):
    points, touches = world

    class Fixed(Meeting):
        def forward(self, points):
            return super().forward(points.view(-1, N, 3))

    with pytest.raises(
        UserError, match=rf"Fixed cannot be run on points of \(2, {N + 1}, 3\): RuntimeError: .*layout="
    ):
        graft(Fixed(None), "layer", probe=(2, N + 1, 3), registry=PLUGINS)
    grafted = graft(Fixed(None), "layer", probe=(1, N, 3), layout="bnc", registry=PLUGINS)
    assert not torch.equal(grafted(points, touches=touches), grafted(points))
    with pytest.raises(UserError, match=r"layer 'layer' gives \(1, 24, 8\) for 1 × 24 points, not .* as 'bcn'"):
        graft(Fixed(None), "layer", probe=(1, N, 3), layout="bcn", registry=PLUGINS)


def test_a_network_that_fails_on_the_probe_is_quoted_in_one_line():
    with pytest.raises(
        UserError, match=r"Layers cannot be run on points of \(2, 256, 3\): ValueError: a slip of theirs\."
    ):
        graft(Layers(), "lift", keywords={"fail": True}, registry=PLUGINS)
    with pytest.raises(UserError, match=r"missing 1 required positional argument: 'rate'.*arguments="):
        graft(PUNetLike(), "mlp2", probe=(1, 3, 32), registry=PLUGINS)


@pytest.mark.parametrize("shape", [(2, 3, 3), (2, 6, 32), (2, 32, 6)])
def test_an_axis_of_coordinates_that_does_not_show_must_be_stated(shape):
    with pytest.raises(UserError, match=rf"probe {re.escape(str(shape))} does not show .*points_layout='bnc' or 'bcn'"):
        graft(nn.Sequential(nn.Linear(6, 8)), "0", probe=shape, registry=PLUGINS)


@pytest.mark.parametrize("points", [-1, 2])
def test_a_position_that_the_arguments_leave_no_room_for_is_refused(points):
    with pytest.raises(UserError, match=rf"points={points} is no position beside 1 others"):
        graft(Second(), "layer", points=points, arguments=(2.0,), registry=PLUGINS)


class Second(Meeting):
    def __init__(self):
        super().__init__(None)

    def forward(self, factor, points):
        return factor * super().forward(points)


@torch.no_grad()
def test_points_may_be_any_argument(world):
    points, touches = world
    grafted = graft(Second(), "layer", points=1, arguments=(2.0,), registry=PLUGINS)
    first = graft(Meeting(None), "layer", registry=PLUGINS)
    first.load_state_dict(grafted.state_dict())
    assert torch.equal(grafted(2.0, points, touches=touches), 2 * first(points, touches=touches))


def test_a_stated_axis_must_hold_coordinates():
    with pytest.raises(UserError, match=r"the probe is \(2, 256, 2\), which is no 'bnc' of at least 3 channels"):
        graft(nn.Sequential(nn.Linear(2, 8)), "0", probe=(2, 256, 2), points_layout="bnc", registry=PLUGINS)


@pytest.mark.parametrize("probe", [(2, 256), (2, 0, 3), torch.zeros(4)])
def test_a_probe_that_is_no_cloud_is_refused(probe):
    with pytest.raises(UserError, match=r"the probe is \(.*\): points are \(b n 3\) or \(b 3 n\)"):
        graft(Meeting(None), "layer", probe=probe, registry=PLUGINS)


def test_channels_behind_the_coordinates_are_allowed_where_stated(world):
    points, touches = world
    network = nn.Sequential(nn.Linear(6, 8), nn.Linear(8, 3))
    grafted = graft(network, "0", probe=torch.rand(1, 5, 6), points_layout="bnc", fusion="concat", registry=PLUGINS)
    normals = torch.randn(3, N, 3)
    heard = []
    grafted.fusion.register_forward_hook(lambda fusion, args, output: heard.append(args[0]))
    assert grafted(torch.cat([points, normals], -1), touches=touches).shape == (3, N, 3)
    assert torch.equal(heard[0], points)


# What a call must bring


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
        UserError, match=r"row 1 of the batch: .* 10\.5 or more from the centre of a cloud of radius 1:"
    ):
        grafted(points, touches=mixed)
    with pytest.raises(UserError, match=r"row 0 .* nan or more"):
        grafted(points, touches=touches * torch.nan)
    grafted(points, touches=far - torch.tensor([0.6, 0, 0]))  # within ten radii
    grafted(points, touches=torch.stack([touches[:, 0], far[:, 0]], 1))  # one of two is near
    grafted(points, touches=mixed, mask=torch.tensor([[True, True], [False, False], [False, False]]))
    with pytest.raises(UserError, match="row 0"):
        grafted(points, touches=torch.stack([touches[:, 0], far[:, 0]], 1), mask=torch.tensor([[False, True]] * 3))


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


def test_a_layer_without_gradients_is_refused_unless_nobody_wants_any(world):
    points, touches = world
    grafted = graft(Layers(), "frozen", registry=PLUGINS)
    with pytest.raises(UserError, match=r"layer 'frozen' runs without gradients"):
        grafted(points, touches=touches)
    with torch.no_grad():
        grafted(points, touches=touches)
    grafted.requires_grad_(False)(points, touches=touches)


# Files


def test_another_network_is_refused_by_its_weights_and_nothing_changes(tmp_path):
    path = tmp_path / "graft.safetensors"
    save_graft(path, graft(nn.Sequential(nn.Linear(3, 8), nn.Linear(8, 3)), "0", registry=PLUGINS))
    wider = nn.Sequential(nn.Linear(3, 8), nn.Linear(8, 5))
    before = copy.deepcopy(wider.state_dict())
    with pytest.raises(
        UserError, match=r"network\.1\.weight is \(3, 8\) in the file, \(5, 8\) in the network"
    ) as caught:
        load_graft(path, wider, PLUGINS)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert same(before.values(), wider.state_dict().values())
    with pytest.raises(UserError, match=r"the network has no network\.1\.bias; the network has no network\.1\.weight"):
        load_graft(path, nn.Sequential(nn.Linear(3, 8)), PLUGINS)
    more = nn.Sequential(nn.Linear(3, 8), nn.Linear(8, 3), nn.Linear(3, 3), nn.Linear(3, 3))
    with pytest.raises(UserError, match=r"the file has no network\.2\.weight; .*network\.3\.weight and 1 more\."):
        load_graft(path, more, PLUGINS)
    with pytest.raises(UserError, match="Meeting has no layer '0': it has layer, head"):
        load_graft(path, Meeting(None), PLUGINS)


def test_weights_that_layers_share_are_saved(tmp_path, world):
    points, touches = world
    network = nn.Sequential(nn.Linear(3, 8), nn.Linear(8, 8), nn.Linear(8, 8))
    network[2].weight = network[1].weight
    grafted = graft(network, "0", registry=PLUGINS).eval()
    save_graft(tmp_path / "graft", grafted)
    other = copy.deepcopy(network)
    with torch.no_grad():
        other[1].weight.zero_()
    loaded = load_graft(tmp_path / "graft", other, PLUGINS)
    assert torch.equal(loaded(points, touches=touches), grafted(points, touches=touches))


def test_what_a_header_cannot_say_is_not_saved(tmp_path):
    grafted = graft(Meeting(None), "layer", fusion=Bias(Widths()), registry=PLUGINS)
    with pytest.raises(UserError, match="the fusion of this graft was given as an instance"):
        save_graft(tmp_path / "graft", grafted)
    with pytest.raises(UserError, match=r"about=\{'device': .*\}: the header of a graft is what JSON can write"):
        save_graft(tmp_path / "graft", graft(Meeting(None), "layer", registry=PLUGINS), {"device": torch.device("cpu")})
    assert not list(tmp_path.iterdir())


def test_files_of_others_are_refused(tmp_path):
    path = tmp_path / "graft"
    with pytest.raises(UserError, match="there is no such file"):
        load_graft(path, Meeting(None), PLUGINS)
    joint = {"at": "layer", "layout": "bnc", "width": 8}
    cards = [{"recipe": {}}, [], {"graft": []}, {"graft": {"joint": joint}}, {"graft": {"joint": joint | {"depth": 1}}}]
    for metadata in (None, {"pcsr": "{"}, *({"pcsr": json.dumps(card)} for card in cards)):
        save_file({"weight": torch.zeros(2)}, path, metadata)
        with pytest.raises(UserError, match="is not a file of save_graft"):
            load_graft(path, Meeting(None), PLUGINS)
    path.write_bytes(b"hello" * 100)
    with pytest.raises(UserError, match="is not a file of save_graft"):
        load_graft(path, Meeting(None), PLUGINS)


# The document


def test_the_documented_example_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (example,) = re.findall(r"```python\n(.*?)```", DOCUMENT.read_text(encoding="utf-8"), re.DOTALL)
    names: dict[str, Any] = {}
    with contextlib.redirect_stdout(None):
        exec(example, names)
    assert isinstance(names["grafted"], Grafted)
    assert (tmp_path / "grafted.safetensors").is_file()


def test_the_file_and_its_function_go_by_one_name():
    import pcsr.graft as module

    assert isinstance(module(Meeting(None), "layer", registry=PLUGINS), Grafted)
