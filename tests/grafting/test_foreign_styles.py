"""Networks in the styles of published code: batch normalisation, channels first, cascades."""

import copy

import pytest
import torch
from torch import nn

from pcsr.errors import UserError
from pcsr.grafting import graft, load_graft, save_graft
from pcsr.grafting.layer_points import LayerPoints
from pcsr.metrics.chamfer import chamfer
from tests.foreign_networks import AT, dense, network
from tests.grafting.networks import PLUGINS, same


@pytest.fixture(params=AT)
def name(request):
    return request.param


def grafted_on(net, at, **options):
    return graft(net, at, touch_encoder={"use": "mlp", "channels": 8}, **({"registry": PLUGINS} | options))


@pytest.mark.parametrize("mode", [True, False])
def test_training_of_the_tactile_parts_leaves_the_output_without_touch_as_it_was(name, mode, world):
    points, touches = (world[0].transpose(1, 2).contiguous(), world[1])
    net = network(name)
    assert any(isinstance(layer, nn.BatchNorm2d) for layer in net.modules())
    reference = dense(copy.deepcopy(net).eval()(points))
    state = copy.deepcopy(net.state_dict())
    grafted = grafted_on(net.train(), AT[name]).train(mode)
    assert torch.equal(dense(grafted(points)), reference)
    before = dense(grafted(points, touches=touches)).detach()
    optimizer = torch.optim.Adam(grafted.tactile_parameters(), lr=1e-2)
    for _ in range(50):
        loss = chamfer(dense(grafted(points, touches=touches)), world[0]).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    assert same(state.values(), grafted.network.state_dict().values())
    assert torch.equal(dense(grafted(points)), reference)
    assert torch.equal(dense(grafted(points, touches=touches, mask=torch.zeros(3, 2, dtype=torch.bool))), reference)
    assert (dense(grafted(points, touches=touches)) - before).abs().max() > 1e-4


def test_a_network_that_is_trained_along_moves_its_statistics(name, world):
    points, touches = (world[0].transpose(1, 2).contiguous(), world[1])
    grafted = grafted_on(network(name), AT[name], frozen=False).train()
    state = copy.deepcopy(grafted.network.state_dict())
    grafted(points, touches=touches)
    moved = [key for key in state if not torch.equal(state[key], grafted.network.state_dict()[key])]
    assert moved
    assert {key.rpartition(".")[2] for key in moved} <= {"running_mean", "running_var", "num_batches_tracked"}


@pytest.mark.parametrize("probe", [256, 128, (1, 3, 64)])
def test_channels_first_are_recognised_from_a_pass(probe, name):
    grafted = grafted_on(network(name), AT[name], probe=probe)
    point = grafted.injection_point
    assert (point.points_layout, point.layout, point.channels) == ("bcn", "bcn", 3)
    assert grafted.calling.rate == 4


def test_a_width_that_is_the_number_of_points_is_no_matter():
    net = nn.Sequential(nn.Conv1d(3, 256, 1), nn.Conv1d(256, 3, 1))
    point = graft(net, "0", registry=PLUGINS).injection_point
    assert (point.points_layout, point.layout, point.width) == ("bcn", "bcn", 256)


@torch.no_grad()
def test_the_second_stage_gets_touch_at_its_own_points(world):
    points, touches = (world[0].transpose(1, 2).contiguous(), world[1])
    net = network("cascade")
    grafted = grafted_on(net, "second.features")
    assert grafted.injection_point.multiple == 2
    fused, shown = [], []
    grafted.fusion.register_forward_hook(lambda fusion, args, output: fused.append(args[0]))
    net.first.register_forward_hook(lambda stage, args, output: shown.append(output.transpose(1, 2)))
    output = grafted(points, touches=touches)
    assert torch.equal(fused[0], shown[0])
    assert fused[0].shape == (3, 2 * points.shape[2], 3)
    assert not torch.equal(output, grafted(points))
    mask = torch.tensor([[True, True], [False, False], [True, False]])
    mixed = grafted(points, touches=touches, mask=mask)
    torch.testing.assert_close(mixed[1], grafted(points)[1])
    torch.testing.assert_close(mixed[0], output[0])
    assert not [layer for layer in net.modules() if layer._forward_pre_hooks], "no hook stays behind"


class Copies(nn.Module):
    """Features of k copies of each point, which are nowhere shown as points."""

    def __init__(self, order):
        super().__init__()
        self.order = order
        self.lift, self.spread, self.head = nn.Linear(3, 8), nn.Linear(8, 12), nn.Linear(12, 3)

    def forward(self, points):
        features = self.lift(points)
        if self.order == "interleaved":
            features = features.repeat_interleave(3, 1)
        elif self.order == "tiled":
            features = features.repeat(1, 3, 1)
        else:
            features = features.repeat(1, 3, 1).flip(1)
        return self.head(self.spread(features))


@pytest.mark.parametrize("order", ["interleaved", "tiled"])
def test_the_order_of_copies_shows_in_the_features_of_a_permuted_cloud(order, world):
    points, _ = world
    point = graft(Copies(order), "spread", registry=PLUGINS).injection_point
    assert (point.multiple, point.order, point.seen) == (3, order, None)
    given = LayerPoints(point, points).get()
    rows = Copies(order)
    rows.lift, rows.spread, rows.head = (nn.Identity() for _ in range(3))
    assert torch.equal(given, rows(points))


def test_copies_in_another_order_are_refused():
    with pytest.raises(UserError, match=r"layer 'spread' has 3 features for each point, and the network shows neither"):
        graft(Copies("backwards"), "spread", registry=PLUGINS)


@torch.no_grad()
def test_saved_and_loaded_it_is_the_same(name, world, tmp_path):
    points, touches = (world[0].transpose(1, 2).contiguous(), world[1])
    grafted = grafted_on(network(name), AT[name]).eval()
    save_graft(tmp_path / "graft.safetensors", grafted)
    loaded = load_graft(tmp_path / "graft.safetensors", network(name, seed=1), PLUGINS)
    assert loaded.injection_point == grafted.injection_point
    for touch in ({}, {"touches": touches}):
        assert torch.equal(dense(loaded(points, **touch)), dense(grafted(points, **touch)))


class Distance(nn.Module):
    """Distances (b 1 m) of queries to a surface, from points and queries, with features in a tuple, as in Grad-PU."""

    def __init__(self):
        super().__init__()
        self.extract = nn.ModuleDict({"mix": nn.Sequential(nn.Conv1d(3, 16, 1), nn.BatchNorm1d(16), nn.ReLU())})
        self.regress = nn.Conv1d(19, 1, 1)

    def forward(self, original_pts, query_pts):
        features = self.extract["mix"](original_pts)
        nearest = torch.cdist(query_pts.transpose(1, 2), original_pts.transpose(1, 2)).argmin(2)
        there = features.gather(2, nearest[:, None].expand(-1, 16, -1))
        return self.regress(torch.cat([there, query_pts], 1)).relu()


def test_a_network_of_distances_is_grafted_but_is_no_upsampler(world):
    points, touches = (world[0].transpose(1, 2).contiguous(), world[1])
    queries = torch.rand(1, 3, 50).expand(2, -1, -1)
    grafted = graft(Distance(), "extract.mix", arguments=(queries,), registry=PLUGINS)
    assert grafted.calling.rate is None
    assert grafted(points, points, touches=touches).shape == (3, 1, points.shape[2])
    assert not torch.equal(grafted(points, points, touches=touches), grafted(points, points))


class NeedsCuda(nn.Module):
    def __init__(self):
        super().__init__()
        self.layer = nn.Linear(3, 8)

    def forward(self, points):
        return self.layer(points.cuda())


@pytest.mark.skipif(torch.cuda.is_available(), reason="there is a CUDA device")
def test_a_network_that_needs_cuda_says_so_in_one_line():
    with pytest.raises(
        UserError, match=r"NeedsCuda cannot be run .* It needs a CUDA device, and there is none"
    ) as error:
        graft(NeedsCuda(), "layer", registry=PLUGINS)
    assert "\n" not in str(error.value)
    assert str(error.value).count("cannot be run") == 1


def test_fusions_of_a_file_are_found(tmp_path, world):
    (tmp_path / "mine.py").write_text(
        "import pcsr\n\n\nclass Mean(pcsr.Fusion):\n    def __init__(self, widths: pcsr.Widths) -> None:\n"
        "        super().__init__()\n\n    def forward(self, points, features, touches):\n"
        "        return features + touches.flat_points.mean((1, 2), keepdim=True)\n\n\n"
        "@pcsr.hookimpl\ndef pcsr_register(register):\n    register.fusion('mean', Mean)\n"
    )
    points, touches = world
    net = nn.Sequential(nn.Linear(3, 8), nn.Linear(8, 3))
    grafted = graft(net, "0", fusion="mean", plugins=[tmp_path / "mine.py"]).eval()
    save_graft(tmp_path / "graft.safetensors", grafted)
    with pytest.raises(UserError, match="there is no fusion 'mean'"):
        load_graft(tmp_path / "graft.safetensors", net)
    loaded = load_graft(tmp_path / "graft.safetensors", net, plugins=[str(tmp_path / "mine.py")])
    assert torch.equal(loaded(points, touches=touches), grafted(points, touches=touches))
    (tmp_path / "broken.py").write_text("import nothing_of_this_name\n")
    with pytest.raises(UserError, match=r"plugin .*broken\.py cannot be loaded: ModuleNotFoundError"):
        graft(net, "0", plugins=[tmp_path / "broken.py"])
