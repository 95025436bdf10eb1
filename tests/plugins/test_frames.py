"""`frames`, encoder, backbone and their layers: neighbourhoods by lengths and angles, and what follows from that."""

from pathlib import Path

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn
from torch.nn import functional as F

from pcsr import TouchBatch, Trait, UserError, Widths
from pcsr.network.network import Network, build
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr_plugins.backbones.local_frames import LocalFrameBackbone
from pcsr_plugins.encoders.local_frames import LocalFrameEncoder
from pcsr_plugins.layers.local_frame_conv import LocalFrameConv
from pcsr_plugins.layers.local_frames import LEAST, SCALARS, LocalFrames, plane
from pcsr_plugins.upsamplers.edge_offsets import EdgeOffsets
from tests.plugins.slow_frames import curved, grid, rotation, slow_edge, slow_frame

RECIPE = Path(__file__).parents[2] / "recipes" / "frames.yaml"
RATE = 4
SEEDS = st.integers(0, 1000)


@pytest.fixture(autouse=True)
def _seed():
    with torch.random.fork_rng():
        torch.manual_seed(5)
        yield


def whole(*overrides: str, seed: int = 0) -> Network:
    """The network of the recipe, which has learned something: as it is built, it moves nothing."""
    (recipe,) = load(RECIPE, load_plugins(), [f"seed={seed}", *overrides])
    net = build(recipe, load_plugins()).double().train()
    nn.init.normal_(net.upsampler.mlp[-1].weight, std=0.05)
    return net


def close(a, b, atol=1e-9):
    torch.testing.assert_close(a, b, atol=atol, rtol=0)


# --- the whole network


@given(seed=SEEDS, scale=st.floats(0.1, 10))
@settings(max_examples=8)
@torch.no_grad()
def test_the_network_moves_turns_and_scales_with_its_cloud(seed, scale):
    points, turn = curved(seed), scale * rotation(seed, torch.float64)
    shift = torch.tensor([0.3, -0.2, 0.1], dtype=torch.float64)
    net = whole(seed=seed)
    dense = net(points, RATE)
    assert (dense - untrained(net)(points, RATE)).abs().max() > 1e-3, "it has learned nothing"
    close(net(points @ turn + shift, RATE), dense @ turn + shift)


def untrained(net):
    """The same network with the upsampler as it is built."""
    return Network(
        net.encoder, None, net.fusion, net.backbone, EdgeOffsets(Widths(refined=net.backbone.channels)).double()
    ).train()


@given(seed=SEEDS, scale=st.floats(0.1, 10))
@settings(max_examples=5)
@torch.no_grad()
def test_with_touches_it_does_so_too(seed, scale):
    points, turn = curved(seed), scale * rotation(seed, torch.float64)
    touches = curved(seed + 1, 40)[:, None, :, :] * 0.9  # all of so few points are inserted
    net = whole(seed=seed)
    cloud, features = net.refine(points, TouchBatch.of(touches))
    turned, as_well = net.refine(points @ turn, TouchBatch.of(touches @ turn))
    for a, f, b, g in zip(cloud @ turn, features, turned, as_well, strict=True):
        order = torch.cdist(a, b).argmin(1)  # a curve through a turned touch runs another way
        close(a, b[order])
        close(f, g[order])


@given(seed=SEEDS)
@settings(max_examples=5)
@torch.no_grad()
def test_in_single_precision_rounding_is_all_that_is_left(seed):
    points, turn = curved(seed).float(), rotation(seed)
    net = whole(seed=seed).float()
    close(net(points @ turn, RATE), net(points, RATE) @ turn, 1e-5)


@given(seed=SEEDS)
@settings(max_examples=5)
@torch.no_grad()
def test_a_plane_stays_a_plane_whatever_the_weights(seed):
    turn, net = rotation(seed, torch.float64), whole(seed=seed)
    nn.init.normal_(net.upsampler.mlp[-1].weight, std=100.0)
    dense, still = (each(grid() @ turn, RATE) for each in (net, untrained(net)))
    assert (dense @ turn.T)[..., 2].abs().max() < 1e-9
    close(dense, still)
    assert (net(curved(), RATE) - untrained(net)(curved(), RATE)).norm(dim=2).max() > 1, "they are weights that move"


@torch.no_grad()
def test_where_the_neighbourhood_is_flat_nothing_moves_whatever_is_rough_elsewhere():
    points = grid()
    left = points[0, :, 0]
    points[..., 2] = torch.where(left > 0, 0.02 * torch.randn(len(left), dtype=torch.float64), 0)
    flat = left < -0.3
    fan = EdgeOffsets(Widths(refined=5), neighbours=8).double()
    features = torch.randn(1, points.shape[1], 5, dtype=torch.float64)
    still = fan(points, features, RATE)
    nn.init.normal_(fan.mlp[-1].weight, std=100.0)
    moved = (fan(points, features, RATE) - still).norm(dim=2).view(points.shape[1], -1).amax(1)
    assert moved[flat].max() < 1e-9
    assert moved[left > 0].min() > 1e-3


# --- frames


@pytest.mark.parametrize(("n", "neighbours"), [(25, 6), (25, 16), (5, 16)])
def test_frames_and_edges_are_those_of_each_point_alone(n, neighbours):
    points = curved(1, n)
    frames = LocalFrames.of(points, neighbours)
    edges = frames.edges()
    k = min(neighbours, n - 1)
    assert edges.shape == (2, n, k, SCALARS)
    for b, row in enumerate(points):
        alone = [slow_frame(row, i, neighbours) for i in range(n)]
        for i, (near, ways, unit, normal, rough) in enumerate(alone):
            assert torch.equal(frames.near[b, i], near)
            close(frames.ways[b, i], ways)
            close(frames.unit[b, i, 0], unit)
            close(frames.normal[b, i], normal)
            close(frames.rough[b, i, 0], rough)
            close(edges[b, i], torch.stack([slow_edge(alone[i], alone[j], ways[s]) for s, j in enumerate(near)]))


@pytest.mark.parametrize(("neighbours", "degrees"), [(8, 2.6), (16, 2.1)])
def test_the_normal_of_a_sphere_is_its_radius_and_points_to_where_most_of_it_lies(neighbours, degrees):
    sphere = F.normalize(torch.randn(1, 2000, 3), dim=2)
    inward = -(LocalFrames.of(sphere, neighbours).normal * sphere).sum(-1)
    off = inward.abs().clamp(max=1).acos().rad2deg().flatten()
    assert off.quantile(0.9) < degrees
    assert off.max() < 10
    assert (inward > 0).float().mean() > 0.98  # few neighbours, all on one side of the point, may seem to bend up


def test_the_normal_of_a_plane_is_exact():
    flat = torch.randn(1, 7, 9, 3)
    flat[..., 2] = 0.25 * flat[..., 0] - 0.5 * flat[..., 1]
    normal = F.normalize(torch.tensor([-0.25, 0.5, 1.0]), dim=0)
    close((plane(flat) @ normal).abs(), torch.ones(1, 7), 1e-6)


def test_an_edge_between_very_different_spacings_is_bounded():
    points = torch.cat([1e-5 * torch.randn(1, 20, 3), torch.randn(1, 20, 3)], 1)
    told = LocalFrames.of(points, 25).edges()[..., 4]
    assert told.abs().max() == 3


@pytest.mark.parametrize("points", [torch.zeros(1, 20, 3), torch.ones(1, 2, 3), torch.arange(60.0).view(1, 20, 3)])
def test_points_that_coincide_or_lie_on_a_line_have_frames(points):
    frames = LocalFrames.of(points, 16)
    assert (frames.unit >= LEAST).all()
    assert frames.edges().isfinite().all()
    close(frames.normal.norm(dim=-1), torch.ones(points.shape[:2]), 1e-5)


def test_frames_have_no_gradient():
    assert not LocalFrames.of(curved().requires_grad_(), 8).edges().requires_grad


# --- the convolution, the encoder, the backbone


def test_a_convolution_is_its_formula_edge_by_edge():
    points, features = curved(2, 20), torch.randn(2, 20, 3, dtype=torch.float64)
    conv, frames = LocalFrameConv(3, 7).double(), LocalFrames.of(points, 6)
    edges, convolved = frames.edges(), conv(features, frames, frames.edges())
    assert convolved.shape == (2, 20, 7)
    for b in range(2):
        for i in range(20):
            heard = []
            for edge, j in zip(edges[b, i], frames.near[b, i], strict=True):
                here, there = conv.here.weight @ features[b, i] + conv.here.bias, conv.there.weight @ features[b, j]
                heard.append(torch.relu(here + there + conv.edge.weight @ edge))
            both = torch.cat([torch.stack(heard).max(0).values, torch.stack(heard).mean(0)])
            close(convolved[b, i], conv.out.weight @ both + conv.out.bias)


def test_gradients_reach_every_weight_and_the_features():
    points, features = curved(), torch.randn(2, 60, 8, dtype=torch.float64, requires_grad=True)
    backbone = LocalFrameBackbone(Widths(visual=8), layers=2).double()
    backbone(points, features).square().sum().backward()
    assert (features.grad != 0).any(2).all()
    encoder = LocalFrameEncoder(Widths()).double()
    encoder(points).square().sum().backward()
    for weight in (*backbone.parameters(), *encoder.parameters()):
        assert weight.grad.isfinite().all()
        assert weight.grad.abs().max() > 0


@pytest.mark.parametrize("layers", [0, 1, 3])
@torch.no_grad()
def test_the_backbone_adds_to_the_features(layers):
    points, features = curved(), torch.randn(2, 60, 8, dtype=torch.float64)
    backbone = LocalFrameBackbone(Widths(visual=8), layers=layers).double()
    frames = LocalFrames.of(points, backbone.neighbours)
    expected = features
    for norm, conv, mlp in zip(backbone.norms, backbone.convolutions, backbone.mlps, strict=True):
        expected = expected + mlp(conv(norm(expected), frames, frames.edges()))
    close(backbone(points, features), expected)
    assert backbone.channels == 8
    assert len(backbone.mlps) == layers


@torch.no_grad()
def test_only_what_is_near_is_heard():
    here, there = curved(0, 30), curved(1, 30)
    encoder, backbone = LocalFrameEncoder(Widths(), channels=8).double(), LocalFrameBackbone(Widths(visual=8)).double()

    def refined(points):
        return backbone(points, encoder(points))

    both, other = (refined(torch.cat([here, 9 + size * there], 1)) for size in (1, 0.1))
    close(both[:, :30], other[:, :30], 0)
    close(both[:, :30], refined(here), 1e-12)
    assert (refined(torch.cat([here, here + 0.01 * there], 1))[:, :30] - both[:, :30]).abs().max() > 1e-3


def test_channels_are_those_asked_for_and_traits_as_claimed():
    encoder, backbone = LocalFrameEncoder(Widths(), channels=24), LocalFrameBackbone(Widths(visual=24))
    assert encoder(curved().float()).shape == (2, 60, 24)
    assert encoder.channels == backbone.channels == 24
    assert encoder.traits == backbone.traits == {Trait.PERMUTATION_EQUIVARIANT}


def test_a_single_point_has_no_neighbourhood():
    with pytest.raises(UserError, match="2 neighbours were asked of 1 points"):
        LocalFrames.of(torch.zeros(1, 1, 3), 16)
