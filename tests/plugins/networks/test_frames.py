"""The network of pcsr/recipes/frames.yaml: it turns, moves and scales with its cloud."""

from pathlib import Path

import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import nn

import pcsr
from pcsr import TouchBatch, Widths
from pcsr.network.build import build
from pcsr.network.network import Network
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr_plugins.upsamplers.edge_offsets import EdgeOffsets
from tests.plugins.slow_frames import curved, grid, rotation

RECIPE = Path(pcsr.__file__).parent / "recipes" / "frames.yaml"
RATE = 4
SEEDS = st.integers(0, 1000)


def whole(*overrides: str, seed: int = 0) -> Network:
    """The network of the recipe, which has learned something: as it is built, it moves nothing."""
    (recipe,) = load(RECIPE, load_plugins(), [f"seed={seed}", *overrides])
    net = build(recipe, load_plugins()).double().train()
    nn.init.normal_(net.upsampler.mlp[-1].weight, std=0.05)
    return net


def close(a, b, atol=1e-9):
    torch.testing.assert_close(a, b, atol=atol, rtol=0)


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
    net, mask = whole(seed=seed), torch.ones(2, 1, dtype=torch.bool)
    cloud, features = net.refine(points, TouchBatch.of(touches, mask))
    turned, as_well = net.refine(points @ turn, TouchBatch.of(touches @ turn, mask))
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
