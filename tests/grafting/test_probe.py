import copy
import re

import pytest
import torch
from torch import nn

from pcsr.contracts import Widths
from pcsr.errors import UserError
from pcsr.grafting import graft
from tests.grafting.networks import PLUGINS, Bias, Layers, Meeting, N, PUNetLike, Second, same


def test_the_probe_finds_layout_and_width(case):
    injection_point = case.graft().injection_point
    assert (injection_point.at, injection_point.layout, injection_point.width) == (case.at, case.layout, case.width)


def test_the_probe_leaves_the_network_and_the_random_state_alone(case):
    network = case.make()
    network.train()
    *_, inner = network.children()
    inner.eval()
    weights, state = copy.deepcopy(network.state_dict()), torch.get_rng_state()
    options = {"fusion": Bias(Widths()), "touch_encoder": None}
    case.graft(network, **options, frozen=False)
    assert torch.equal(torch.get_rng_state(), state)
    assert network.training
    assert not inner.training
    case.graft(network, **options)
    assert not network.training, "frozen"
    assert same(weights.values(), network.state_dict().values())
    assert not any(module._forward_hooks or module._forward_pre_hooks for module in network.modules())


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


@pytest.mark.parametrize(
    ("at", "message"),
    [
        ("lift2", r"Layers has no layer 'lift2': did you mean 'lift'\?"),
        ("encoder.lift", r"no layer 'encoder\.lift': did you mean 'lift' or 'inner\.lift'\?"),
        ("", r"no layer ''\. It can be grafted at 'lift' \(8 channels\), 'frozen' \(8 channels\), 'inner\.lift'"),
        ("never", "layer 'never' is called 0 times"),
        ("again", "layer 'again' is called 3 times"),
        ("pair", "layer 'pair' gives a tuple, not a tensor"),
        ("sampled", r"gives \(2, 128, 8\) for 256 points and \(2, 256, 8\) for 512 points: .*as after a sampling"),
        ("merged", r"gives \(1, 512, 8\) for 256 points and \(1, 1024, 8\) for 512 points: not one feature"),
        ("pooled", r"gives \(2, 8\) for 256 points and \(2, 8\) for 512 points: not one feature for each point"),
        ("flat", r"gives \(512, 8\) for 256 points and \(1024, 8\) for 512 points: not one feature for each point"),
        ("edges", r"gives \(2, 8, 256, 4\) .*: not one feature for each point"),
        ("square", r"gives \(2, 256, 256\) .*: its width is ambiguous"),
        ("growing", r"gives \(2, 256, 2048\) .*: its width is ambiguous"),
    ],
)
def test_a_layer_that_does_not_give_a_feature_for_each_point_is_refused(at, message):
    with pytest.raises(UserError, match=message) as caught:
        graft(Layers(), at, probe=(1, 256, 3), registry=PLUGINS)
    assert "\n" not in str(caught.value)
    assert "It can be grafted at 'lift' (8 channels)" in str(caught.value)


def test_layers_that_a_message_names_can_be_grafted():
    with pytest.raises(UserError, match="is called 0 times") as caught:
        graft(Layers(), "never", registry=PLUGINS)
    named = re.findall(r"'([\w.]+)' \(8 channels\)", str(caught.value))
    assert named == ["lift", "frozen", "inner.lift"]
    for at in named:
        assert graft(Layers(), at, registry=PLUGINS).injection_point.width == 8
    with pytest.raises(UserError, match="It has no layer that can be grafted"):
        graft(nn.Sequential(nn.Linear(3, 3)), "1", registry=PLUGINS)


class Pair(nn.Module):
    def __init__(self):
        super().__init__()
        self.one = nn.Linear(8, 8)

    def forward(self, x):
        return self.one(x), x


class First(nn.Module):
    def forward(self, pair):
        return pair[0]


def test_of_a_layer_that_gives_no_tensor_the_ones_inside_are_offered():
    network = nn.Sequential(nn.Linear(3, 8), Pair(), First(), nn.Linear(8, 3))
    with pytest.raises(UserError, match=r"layer '1' gives a tuple, not a tensor: .* can be grafted at .*'1\.one' "):
        graft(network, "1", registry=PLUGINS)
    assert graft(network, "1.one", registry=PLUGINS).injection_point.width == 8


class Squeezing(nn.Module):
    """(b n 3) to (b 2n 3); the axis of a single cloud is squeezed away."""

    def __init__(self):
        super().__init__()
        self.layer, self.norm, self.head = nn.Conv1d(3, 8, 1), nn.BatchNorm1d(8), nn.Conv1d(8, 6, 1)

    def forward(self, points):
        features = self.norm(self.layer(points.transpose(1, 2)).unsqueeze(3).squeeze())
        return points.repeat(1, 2, 1) + self.head(features).unflatten(1, (3, 2)).flatten(2).transpose(1, 2)


def test_a_network_that_fails_on_one_cloud_needs_two():
    grafted = graft(Squeezing(), at="layer", probe=16)
    assert (grafted.injection_point.smallest_batch, grafted.calling.rate) == (2, 2)
    plain = nn.Sequential(nn.Linear(3, 8), nn.Linear(8, 3))
    assert graft(plain, at="0").injection_point.smallest_batch == 1


class Strict(nn.Module):
    """It takes N points only."""

    def __init__(self, width):
        super().__init__()
        self.layer = nn.Linear(3, width)

    def forward(self, points):
        if points.shape[1] != N:
            raise ValueError("another number of points")
        return self.layer(points)


def test_one_number_of_points_shows_the_layout_unless_the_width_is_a_multiple_of_it(world):
    assert graft(Strict(8), "layer", probe=N, registry=PLUGINS).injection_point.layout == "bnc"
    with pytest.raises(UserError, match="its width is ambiguous"):
        graft(Strict(N), "layer", probe=N, registry=PLUGINS)
    assert graft(Strict(N), "layer", probe=N, layout="bnc", registry=PLUGINS).injection_point.width == N


def test_a_stated_layout_needs_one_number_of_points_only(world):
    points, touches = world

    class Fixed(Meeting):
        def forward(self, points):
            return super().forward(points.view(-1, N, 3))

    with pytest.raises(UserError, match=rf"Fixed cannot be run on points of \(2, {N + 1}, 3\): RuntimeError: .*probe="):
        graft(Fixed(None), "layer", probe=(2, N + 1, 3), registry=PLUGINS)
    grafted = graft(Fixed(None), "layer", probe=(1, N, 3), layout="bnc", registry=PLUGINS)
    assert not torch.equal(grafted(points, touches=touches), grafted(points))
    with pytest.raises(UserError, match=r"layer 'layer' gives \(1, 24, 8\) for 24 points: not .* as 'bcn'"):
        graft(Fixed(None), "layer", probe=(1, N, 3), layout="bcn", registry=PLUGINS)


def test_a_network_that_fails_on_the_probe_is_quoted_in_one_line():
    with pytest.raises(
        UserError, match=r"Layers cannot be run on points of \(2, 256, 3\): ValueError: a slip of theirs; nor on .*\."
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


def test_a_stated_axis_must_hold_coordinates():
    with pytest.raises(UserError, match=r"the probe is \(2, 256, 2\), which is no 'bnc' of at least 3 channels"):
        graft(nn.Sequential(nn.Linear(2, 8)), "0", probe=(2, 256, 2), points_layout="bnc", registry=PLUGINS)


@pytest.mark.parametrize("probe", [(2, 256), (2, 0, 3), torch.zeros(4)])
def test_a_probe_that_is_no_cloud_is_refused(probe):
    with pytest.raises(UserError, match=r"the probe is \(.*\): points are \(b n 3\) or \(b 3 n\)"):
        graft(Meeting(None), "layer", probe=probe, registry=PLUGINS)
