"""The parts of TAPSR's network, each against a slow and obvious form of itself."""

import pytest
import torch
from torch import nn
from torch.nn import functional as F

import pcsr
from pcsr import TouchBatch, Trait, UserError, Widths
from pcsr.geometry.neighbours import gather, knn
from pcsr.geometry.ordering import hilbert_order
from pcsr.metrics.chamfer import chamfer
from pcsr.network.network import Network
from pcsr_plugins.backbones.pu_transformer import EdgeMax, PUTransformer, ShiftedChannelAttention
from pcsr_plugins.encoders.mlp import Mlp
from pcsr_plugins.encoders.unet import UNet
from pcsr_plugins.fusions.concat import Concat
from pcsr_plugins.fusions.iterative import Iterative
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.fusions.pairing import pair
from pcsr_plugins.objectives.chamfer import Chamfer
from pcsr_plugins.upsamplers.shuffle import Shuffle, neighbour_offsets
from tests.plugins.plain import plain

WIDTHS = Widths(visual=8, touch=4, refined=12, rate=3)


@pytest.fixture(autouse=True)
def _seed():
    with torch.random.fork_rng():
        torch.manual_seed(7)
        yield


def touched(mask: list[list[bool]], points: int = 10) -> TouchBatch:
    shape = (len(mask), len(mask[0]), points)
    return TouchBatch(torch.randn(*shape, 3), torch.randn(*shape, WIDTHS.touch), torch.tensor(mask))


def close(a: torch.Tensor, b: torch.Tensor, atol: float = 1e-5) -> None:
    torch.testing.assert_close(a, b, atol=atol, rtol=0)


# --- encoders


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


def test_mlp_sees_each_point_alone():
    mlp, points = Mlp(Widths(), channels=5), torch.randn(2, 9, 3)
    close(mlp(points)[:, 4:5], mlp(points[:, 4:5]), 1e-6)


# --- fusions


def test_pairing_walks_both_curves_in_step():
    points, touches = torch.randn(2, 13, 3), touched([[True, True, True]] * 2, 5)
    met = pair(points, touches)
    for b in range(2):
        for a in range(3):
            walk = hilbert_order(touches.points)[b, a]
            for step, point in enumerate(hilbert_order(points)[b]):
                assert torch.equal(met[b, a, point], touches.features[b, a, walk[step * 5 // 13]])


def algorithm_1(fusion: Iterative, points: torch.Tensor, fp: torch.Tensor, touches: list[torch.Tensor]) -> torch.Tensor:
    """Algorithm 1 of one object, word by word: f1 = fp; for each touch Fm = MLP[ft, f], f = Deconv[Fm, fp].

    `touches` holds the feature that each visual point meets, (n c) for each touch.
    """
    order = hilbert_order(points)
    n, linear, weight = len(points), fusion.mlp[0], fusion.deconv.weight  # weight: (in out 3)
    f = fp
    for ft in touches:
        fm = torch.stack([F.relu(linear.weight @ torch.cat([ft[i], f[i]]) + linear.bias) for i in range(n)])
        if fusion.pool == "global":
            fm = torch.stack([fm.max(0).values] * n)
        x = torch.cat([fm, fp], dim=1)
        after = torch.zeros_like(fp)
        for step in range(n):
            after[order[step]] = fusion.deconv.bias
            for tap in range(3):  # a deconvolution sends step s to s - 1, s and s + 1
                sender = step + 1 - tap
                if 0 <= sender < n:
                    after[order[step]] += x[order[sender]] @ weight[:, :, tap]
        f = after
    return f


@pytest.mark.parametrize("pool", ["none", "global"])
@torch.no_grad()
def test_iterative_is_algorithm_1_and_a_row_skips_the_touches_it_lacks(pool):
    fusion, points, features = Iterative(WIDTHS, pool=pool), torch.randn(4, 11, 3), torch.randn(4, 11, WIDTHS.visual)
    touches = touched([[True, True, True], [True, False, True], [False, True, False], [True, False, False]])
    fused, met = fusion(points, features, touches), pair(points, touches)
    for b in range(4):
        heard = [met[b, a] for a in range(3) if touches.mask[b, a]]
        close(fused[b], algorithm_1(fusion, points[b], features[b], heard))


def test_iterative_has_one_block_for_every_touch():
    fusion, points, features = Iterative(WIDTHS), torch.randn(1, 8, 3), torch.randn(1, 8, WIDTHS.visual)
    for count in (1, 6):
        assert fusion(points, features, touched([[True] * count])).shape == features.shape


@pytest.mark.parametrize("fusion", [Iterative, Concat])
def test_fusions_follow_a_permutation(fusion):
    part, points, features = fusion(WIDTHS), torch.randn(2, 11, 3), torch.randn(2, 11, WIDTHS.visual)
    touches, shuffled = touched([[True, True], [True, False]]), torch.randperm(11)
    close(part(points[:, shuffled], features[:, shuffled], touches), part(points, features, touches)[:, shuffled])


@torch.no_grad()
def test_concat_counts_missing_touches_as_zeros():
    fusion, points, features = Concat(WIDTHS, touches=4), torch.randn(2, 7, 3), torch.randn(2, 7, WIDTHS.visual)
    touches = touched([[True, True, True], [True, False, True]])
    fused, met, nothing = fusion(points, features, touches), pair(points, touches), torch.zeros(7, WIDTHS.touch)
    close(fused[0], fusion.layer(torch.cat([features[0], met[0, 0], met[0, 1], met[0, 2], nothing], 1)))
    close(fused[1], fusion.layer(torch.cat([features[1], met[1, 0], nothing, met[1, 2], nothing], 1)))


def test_concat_refuses_more_touches_than_slots():
    fusion, points, features = Concat(WIDTHS, touches=2), torch.randn(1, 7, 3), torch.randn(1, 7, WIDTHS.visual)
    fusion(points, features, touched([[True, True]]))
    with pytest.raises(UserError, match=r"slots for 2 touches, got 3: set model\.fusion\.touches to 3"):
        fusion(points, features, touched([[True, True, True]]))


def test_none_joins_the_raw_points_and_leaves_features_alone():
    fusion, points, features = NoFusion(WIDTHS), torch.randn(2, 7, 3), torch.randn(2, 7, WIDTHS.visual)
    touches = touched([[True, False, True], [False, True, True]])
    joined = fusion.join(points, touches)
    assert torch.equal(joined[0], torch.cat([points[0], touches.points[0, 0], touches.points[0, 2]]))
    assert torch.equal(joined[1], torch.cat([points[1], touches.points[1, 1], touches.points[1, 2]]))
    assert torch.equal(fusion(points, features, touches), features)
    assert not fusion.uses_touch_features


def test_none_refuses_rows_of_unequal_counts():
    touches = touched([[True, True], [True, False]])
    with pytest.raises(UserError, match=r"same number of touches in each row, got \[2, 1\]"):
        NoFusion(WIDTHS).join(torch.randn(2, 7, 3), touches)


# --- backbone


def test_edge_max_is_the_edge_mlp_and_the_maximum_forward_and_backward():
    layer, x, points = EdgeMax(6, 5), torch.randn(2, 15, 6, requires_grad=True), torch.randn(2, 15, 3)
    near = knn(points, points, 4)
    centre = x.unsqueeze(2).expand(-1, -1, 4, -1)
    plain = F.relu(layer.edge(torch.cat([centre, gather(x, near) - centre], dim=-1))).amax(2)
    fast = layer(x, near)
    close(fast, plain)
    towards = torch.randn_like(plain)
    wanted = (x, *layer.parameters())
    for a, b in zip(
        torch.autograd.grad(fast, wanted, towards), torch.autograd.grad(plain, wanted, towards), strict=True
    ):
        close(a, b, 1e-4)


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


# --- all together


def example(counts: tuple[int, int], dtype: torch.dtype) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Two clouds of TAPSR's own size, with touches."""
    generator = torch.Generator().manual_seed(0)
    points = F.normalize(torch.randn(2, 512, 3, generator=generator), dim=-1).to(dtype)
    touches = torch.randn(2, 4, 512, 3, generator=generator).to(dtype) / 4
    return points, TouchBatch.of(touches, torch.arange(4) < torch.tensor(counts)[:, None])


@pytest.mark.parametrize("counts", [(0, 0), (4, 4), (1, 3)])
@torch.no_grad()
def test_the_network_is_its_plain_twin(counts):
    """Of TAPSR's own size and weights: 512 points, rate 16, single precision."""
    network = pcsr.load("tapsr").network
    points, touches = example(counts, torch.float32)
    close(network(points, 16, touches), plain(network)(points, 16, touches))


@pytest.mark.parametrize("counts", [(0, 0), (4, 4), (1, 3)])
def test_the_network_has_the_gradients_of_its_plain_twin(counts):
    """In double precision. In single some of the millions of maxima are tied but for rounding, and each processor
    breaks ties in its own way: the gradients of single precision are held part by part, where ties can be left out.
    """
    network = pcsr.load("tapsr").network.double()
    twin = plain(network)
    points, touches = example(counts, torch.float64)
    dense, expected = network(points, 16, touches), twin(points, 16, touches)
    towards = torch.randn(dense.shape, generator=torch.Generator().manual_seed(1), dtype=dense.dtype)
    for output in (dense, expected):
        (output * towards).sum().backward()
    for (name, ours), wanted in zip(network.named_parameters(), twin.parameters(), strict=True):
        if wanted.grad is None:
            assert ours.grad is None, name
        elif not name.endswith("key.bias"):  # softmax does not depend on it: its gradient is rounding alone
            assert (ours.grad - wanted.grad).norm() <= 1e-9 * wanted.grad.norm(), name


LONGEST = 2048
"""Terms of the longest sum in the gradients of the parts below: points of a batch, or channels times neighbours."""
TIED = 1e-4
"""Values that are closer than this may change places in single precision."""


def gradients(part: nn.Module, output: torch.Tensor, towards: torch.Tensor) -> list[torch.Tensor]:
    return list(torch.autograd.grad((output * towards.to(output.dtype)).sum(), list(part.parameters())))


def check_single_precision(part: nn.Module, call, towards: torch.Tensor) -> None:
    """Gradients of a part in single precision beside those of its plain twin in double.

    A sum of n terms is off by at most n roundings (Higham, "Accuracy and Stability of Numerical Algorithms", Sec. 4.2).
    """
    twin = plain(part).double()
    ours, wanted = (gradients(one, call(one), towards) for one in (part, twin))
    for (name, _), one, other in zip(part.named_parameters(), ours, wanted, strict=True):
        if name != "key.bias":
            off = (one.double() - other).norm() / other.norm()
            assert off <= LONGEST * torch.finfo(torch.float32).eps, (name, off)


def like(part: nn.Module, tensor: torch.Tensor) -> torch.Tensor:
    """A tensor in the precision of a part's weights."""
    return tensor.to(next(part.parameters()).dtype)


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


def test_the_fusion_has_its_gradients_in_single_precision():
    fusion, points = Iterative(WIDTHS), torch.randn(2, 200, 3)
    features, touches = torch.randn(2, 200, WIDTHS.visual), touched([[True, True, False], [True, True, True]], 200)

    def call(part: nn.Module) -> torch.Tensor:
        given = TouchBatch(like(part, touches.points), like(part, touches.features), touches.mask)
        return part(like(part, points), like(part, features), given)

    check_single_precision(fusion, call, torch.randn(2, 200, WIDTHS.visual))


def test_the_upsampler_has_its_gradients_in_single_precision():
    widths, points, features = Widths(refined=64, rate=16), torch.randn(2, 60, 3), torch.randn(2, 60, 64)
    shuffle = Shuffle(widths, start="neighbours")
    torch.nn.init.normal_(shuffle.mlp[2].weight)
    check_single_precision(
        shuffle, lambda part: part(like(part, points), like(part, features), 16), torch.randn(2, 960, 3)
    )


# --- upsampler and objective


def test_shuffle_cuts_each_point_into_pieces_of_its_channels():
    shuffle, points, features = Shuffle(WIDTHS, hidden=6), torch.randn(2, 5, 3), torch.randn(2, 5, 12)
    dense = shuffle(points, features, 3)
    assert dense.shape == (2, 15, 3)
    for i in range(5):
        for r in range(3):
            close(dense[:, 3 * i + r], shuffle.mlp(features[:, i, 4 * r : 4 * r + 4]), 1e-6)


def test_shuffle_can_start_at_the_input_points():
    origin, point = Shuffle(WIDTHS), Shuffle(WIDTHS, start="point")
    point.load_state_dict(origin.state_dict())
    points, features = torch.randn(1, 5, 3), torch.randn(1, 5, 12)
    way = (point(points, features, 3) - origin(points, features, 3)).view(1, 5, 3, 3)
    close(way, points.unsqueeze(2).expand(-1, -1, 3, -1))


def test_shuffle_can_start_on_the_ways_to_the_neighbours():
    widths, points, features = Widths(refined=32, rate=16), torch.randn(2, 30, 3), torch.randn(2, 30, 32)
    shuffle = Shuffle(widths, start="neighbours")
    places, spacing = neighbour_offsets(points, 16)
    close(shuffle(points, features, 16), places, 1e-6)  # untrained it is the fan itself
    with torch.no_grad():
        shuffle.mlp[2].bias.fill_(0.5)
    moved = (shuffle(points, features, 16) - places).view(2, 30, 16, 3)
    close(moved, 0.5 * spacing.unsqueeze(-1).expand(2, 30, 16, 3), 1e-5)


@pytest.mark.parametrize("rate", [1, 4, 8, 12, 16])
def test_a_fan_reaches_out_to_the_nearest_neighbours(rate):
    points = torch.randn(1, 40, 3).double()
    places, spacing = neighbour_offsets(points, rate)
    places = places.view(40, rate, 3)
    spokes, rings = min(8, rate), -(-rate // min(8, rate))
    for i in range(40):
        distance = (points[0] - points[0, i]).norm(dim=-1)
        nearest = distance.argsort()[1 : spokes + 1]
        close(spacing[0, i, 0], distance[nearest].mean(), 1e-9)
        for j in range(rate):
            share = 0.4 * (1 - (j // spokes) / rings)
            close(places[i, j], points[0, i] + share * (points[0, nearest[j % spokes]] - points[0, i]), 1e-7)
    assert len(places.flatten(0, 1).unique(dim=0)) == 40 * rate


def test_the_fan_of_a_larger_cloud_is_larger():
    points, features = torch.randn(1, 30, 3), torch.randn(1, 30, 32)
    shuffle = Shuffle(Widths(refined=32, rate=16), start="neighbours")
    torch.nn.init.normal_(shuffle.mlp[2].weight)
    close(shuffle(5 * points, features, 16), 5 * shuffle(points, features, 16), 1e-4)


def test_shuffle_refuses_another_rate():
    with pytest.raises(UserError, match="built for rate 3, not 4"):
        Shuffle(WIDTHS)(torch.randn(1, 5, 3), torch.randn(1, 5, 12), 4)


def test_shuffle_refuses_channels_that_the_rate_does_not_divide():
    with pytest.raises(UserError, match="12 channels into 5 equal pieces, which leaves 2 over"):
        Shuffle(Widths(refined=12, rate=5))


def test_objective_is_the_mean_chamfer_distance():
    a, b = torch.randn(3, 9, 3), torch.randn(3, 14, 3)
    losses = Chamfer()(a, b)
    assert list(losses) == ["chamfer"]
    close(losses["chamfer"], sum(chamfer(a[i : i + 1], b[i : i + 1])[0] for i in range(3)) / 3)


def test_every_part_is_a_module_with_weights_or_none_at_all():
    trained = (UNet(WIDTHS, channels=8), Iterative(WIDTHS), Concat(WIDTHS), PUTransformer(WIDTHS), Shuffle(WIDTHS))
    assert all(isinstance(part, nn.Module) and list(part.parameters()) for part in trained)
    assert not list(NoFusion(WIDTHS).parameters())
