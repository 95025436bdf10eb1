"""`unet`, the FE block (TAPSR, Sec. 3.2): any number of points, in the order of the Hilbert curve."""

import pytest
import torch
from torch import nn
from torch.nn import functional as F

from pcsr import Trait, Widths
from pcsr.geometry.ordering import hilbert_order
from pcsr_plugins.encoders.unet import UNet
from tests.plugins.compare import close


@pytest.mark.parametrize("order", ["hilbert", "file"])
@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 17, 30, 64])
def test_unet_takes_any_number_of_points(n, order):
    features = UNet(Widths(), channels=8, order=order)(torch.randn(2, n, 3))
    assert features.shape == (2, n, 8)
    assert features.isfinite().all()


@pytest.mark.parametrize("n", [31, 32])
def test_unet_along_the_curve_follows_a_permutation(n):
    unet, points, shuffled = UNet(Widths(), channels=8), torch.randn(2, n, 3), torch.randperm(n)
    assert Trait.PERMUTATION_EQUIVARIANT in unet.traits
    close(unet(points[:, shuffled]), unet(points)[:, shuffled])


def test_unet_in_file_order_does_not_and_says_so():
    unet, points, shuffled = UNet(Widths(), channels=8, order="file"), torch.randn(2, 31, 3), torch.randperm(31)
    assert Trait.PERMUTATION_EQUIVARIANT not in unet.traits
    assert Trait.PERMUTATION_EQUIVARIANT in UNet.traits
    assert (unet(points[:, shuffled]) - unet(points)[:, shuffled]).abs().max() > 1e-3


def test_unet_orders_differ_only_by_the_order():
    by_curve, by_file = UNet(Widths(), channels=8), UNet(Widths(), channels=8, order="file")
    by_file.load_state_dict(by_curve.state_dict())
    points = torch.randn(1, 21, 3)
    sorted_points = points[:, hilbert_order(points)[0]]
    close(by_file(sorted_points), by_curve(sorted_points))


def literal(unet: UNet, points: torch.Tensor) -> torch.Tensor:
    """TAPSR, Sec. 3.2: of one cloud (n 3), step by step along the axis."""

    def conv(layer, x):
        near = [torch.stack([x[max(i - 1, 0)], x[i], x[min(i + 1, len(x) - 1)]], 1) for i in range(len(x))]
        return torch.stack([F.relu((layer[0].weight * one).sum((1, 2)) + layer[0].bias) for one in near])

    def pool(x):  # "downsampled two times by the max-pooling layer"
        return torch.stack([torch.maximum(x[i], x[i + 1]) for i in range(0, len(x), 2)])

    def deconv(layer, x):  # "upsampled two times by the deconvolution": each step becomes two
        weight, bias = layer[0].weight, layer[0].bias  # weight: (in out 2)
        return F.relu(torch.stack([one @ weight[:, :, side] + bias for one in x for side in range(2)]))

    x = points
    for layer in unet.enter:
        x = conv(layer, x)
    half = conv(unet.down[0], pool(x))
    quarter = conv(unet.down[1], pool(half))
    # "The skip connection is used at the same stage."
    up = conv(unet.merge[0], torch.cat([deconv(unet.up[0], quarter), half], 1))
    both = torch.cat([deconv(unet.up[1], up), x], 1)
    return both @ unet.merge[1].weight[:, :, 0].T + unet.merge[1].bias


@torch.no_grad()
def test_unet_is_the_block_of_the_paper_step_by_step():
    unet, points = UNet(Widths(), channels=8).double(), torch.randn(2, 14, 3).double()
    features = unet(points)
    for b, order in enumerate(hilbert_order(points)):
        along = points[b, order]
        padded = torch.cat([along, along[-1:], along[-1:]])  # to a multiple of four
        close(features[b, order], literal(unet, padded)[:14], 1e-9)


def test_unet_halves_its_channels_on_entering_and_doubles_them_at_the_bottom():
    unet = UNet(Widths(), channels=8)
    assert [layer[0].out_channels for layer in (*unet.enter, *unet.down, *unet.up)] == [4, 8, 8, 16, 8, 8]
    assert unet(torch.randn(1, 5, 3)).shape[-1] == unet.channels


def test_a_layer_norm_gives_each_point_features_of_one_scale_before_each_relu():
    unet = UNet(Widths(), channels=8, norm="layer")
    points = torch.randn(2, 12, 3)
    seen = []
    for layer in (*unet.enter, *unet.down, *unet.up, unet.merge[0]):
        layer[-1].register_forward_hook(lambda module, given, made: seen.append(given[0]))
    features = unet(points)
    assert len(seen) == 7
    for x in seen:  # (b c n)
        close(x.mean(1), torch.zeros_like(x[:, 0]), 1e-5)
        assert x.var(1, unbiased=False).max() <= 1 + 1e-5
    assert seen[0].var(1, unbiased=False).min() > 0.99
    assert features.shape == (2, 12, 8)


def test_every_relu_has_the_slope():
    for slope, kind in ((0.0, nn.ReLU), (0.2, nn.LeakyReLU)):
        unet = UNet(Widths(), channels=8, negative_slope=slope)
        found = [layer[-1] for layer in (*unet.enter, *unet.down, *unet.up, unet.merge[0])]
        assert all(type(layer) is kind for layer in found)
        assert all(getattr(layer, "negative_slope", 0.0) == slope for layer in found)


def test_without_a_norm_features_hardly_vary_from_point_to_point():
    points = F.normalize(torch.randn(2, 64, 3), dim=-1)
    with_norm, without = (UNet(Widths(), channels=32, norm=norm)(points).std(1).mean() for norm in ("layer", "none"))
    assert with_norm > 5 * without
