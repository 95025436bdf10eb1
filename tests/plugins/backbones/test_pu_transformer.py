"""`pu-transformer`: edge MLPs and shifted channel attention (PU-Transformer, Sec. 3)."""

import pytest
import torch
from torch.nn import functional as F

from pcsr import Widths
from pcsr.geometry.neighbours import gather, knn
from pcsr.network.network import Network
from pcsr_plugins.backbones.pu_transformer import EdgeMax, PUTransformer, ShiftedChannelAttention
from pcsr_plugins.encoders.mlp import Mlp
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.upsamplers.shuffle import Shuffle
from tests.plugins.compare import TIED, check_single_precision, close, like, same_gradients


@pytest.mark.parametrize("slope", [0.0, 0.2])
def test_edge_max_is_the_edge_mlp_and_the_maximum_forward_and_backward(slope):
    layer, x, points = EdgeMax(6, 5, slope), torch.randn(2, 15, 6, requires_grad=True), torch.randn(2, 15, 3)
    near = knn(points, points, 4)
    centre = x.unsqueeze(2).expand(-1, -1, 4, -1)
    plain = F.leaky_relu(layer.edge(torch.cat([centre, gather(x, near) - centre], dim=-1)), slope).amax(2)
    fast = layer(x, near)
    close(fast, plain)
    same_gradients(fast, plain, (x, *layer.parameters()), atol=1e-4, rtol=0)


@torch.no_grad()
def test_shifted_channel_attention_has_seven_heads_each_half_a_window_further():
    layer, x = ShiftedChannelAttention(16, 4), torch.randn(2, 9, 16)
    assert layer.out.in_features == 7 * 4
    heads = []
    for start in range(0, 13, 2):
        q, k, v = (part(x)[..., start : start + 4] for part in (layer.query, layer.key, layer.value))
        heads.append(torch.softmax(q @ k.transpose(1, 2), dim=-1) @ v)
    assert len(heads) == 7
    close(layer(x), layer.out(torch.cat(heads, dim=-1)))


@pytest.mark.parametrize("channels", [8, 32, 256])
def test_four_windows_make_seven_heads_at_every_width(channels):
    assert ShiftedChannelAttention(channels, 4).out.in_features == 7 * channels // 4


def test_backbone_follows_a_permutation_and_gives_its_last_width():
    backbone = PUTransformer(Widths(visual=8), channels=(8, 16), neighbours=5)
    points, features, shuffled = torch.randn(2, 20, 3), torch.randn(2, 20, 8), torch.randperm(20)
    refined = backbone(points, features)
    assert refined.shape == (2, 20, backbone.channels) == (2, 20, 16)
    close(backbone(points[:, shuffled], features[:, shuffled]), refined[:, shuffled])


def test_pu_transformer_is_as_large_as_published():
    widths = Widths(visual=16, rate=4)
    backbone = PUTransformer(widths)
    upsampler = Shuffle(Widths(visual=16, refined=backbone.channels, rate=4))
    network = Network(Mlp(widths), None, NoFusion(widths), backbone, upsampler)
    assert network.parameter_count == 1_000_355  # published: 969.9 K; PAPER.md


def test_edge_max_has_its_gradients_in_single_precision_where_nothing_is_tied():
    layer, x, points = EdgeMax(24, 32), torch.randn(2, 200, 24), torch.randn(2, 200, 3)
    near = knn(points, points, 8)
    centre = x.unsqueeze(2).expand(-1, -1, 8, -1)
    two = layer.edge(torch.cat([centre, gather(x, near) - centre], dim=-1)).topk(2, dim=2).values
    clear = ((two[:, :, 0] - two[:, :, 1]).abs() > TIED) & (two[:, :, 0].abs() > TIED)  # nor at the bend of ReLU
    assert clear.float().mean() > 0.99
    towards = torch.randn(clear.shape) * clear
    check_single_precision(layer, lambda part: part(like(part, x), near), towards)


def test_attention_has_its_gradients_in_single_precision():
    layer, x = ShiftedChannelAttention(64, 4), torch.randn(2, 200, 64)
    check_single_precision(layer, lambda part: part(like(part, x)), torch.randn(2, 200, 64))
