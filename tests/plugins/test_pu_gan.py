"""PU-GAN's expansion, discriminator and objective, each against a slow and obvious form of itself."""

import math

import pytest
import torch
from torch.nn import functional as F
from torch.nn.attention import SDPBackend, sdpa_kernel

from pcsr import UserError, Widths
from pcsr.geometry.farthest import farthest_points
from pcsr.network.network import Network
from pcsr_plugins.backbones.dense_edge_conv import DenseEdgeConvs
from pcsr_plugins.encoders.linear import Linear
from pcsr_plugins.fusions.none import NoFusion
from pcsr_plugins.layers.grid import grid
from pcsr_plugins.layers.point_losses import hinge_repulsion, matched_distance
from pcsr_plugins.layers.self_attention import SelfAttention
from pcsr_plugins.objectives.pu_gan import SHARES, Discriminator, PuGan, uniformity
from pcsr_plugins.upsamplers.up_down_up import UpDownUp


@pytest.fixture(autouse=True)
def _seed():
    with torch.random.fork_rng():
        torch.manual_seed(7)
        yield


def awake(module):
    """With the attention's γ away from 0, where it starts and where no gradient gets past it."""
    with torch.no_grad():
        for name, weight in module.named_parameters():
            if name.endswith("gamma"):
                weight.fill_(0.7)
    return module


def network(rate: int = 4, neighbours: int = 16, **options) -> Network:
    widths = Widths(visual=24, rate=rate)
    backbone = DenseEdgeConvs(widths, neighbours=neighbours)
    upsampler = UpDownUp(Widths(visual=24, refined=backbone.channels, rate=rate), **options)
    return Network(Linear(widths), None, NoFusion(widths), backbone, upsampler)


def count(module) -> int:
    return sum(weight.numel() for weight in module.parameters())


def sphere(n: int, dtype=torch.float32) -> torch.Tensor:
    return F.normalize(torch.randn(n, 3, dtype=dtype), dim=-1)


# --- the network


def test_generator_and_discriminator_are_as_large_as_published():
    assert count(network()) == 541_601  # 541.6 K
    assert count(Discriminator()) == 142_594  # 142.6 K


@pytest.mark.parametrize(("copies", "columns", "rows"), [(1, 1, 1), (2, 2, 1), (4, 2, 2), (5, 1, 5), (6, 3, 2)])
def test_the_grid_is_nearly_square(copies, columns, rows):
    places = grid(copies)
    assert places.shape == (copies, 2) == (columns * rows, 2)
    assert (len(places[:, 0].unique()), len(places[:, 1].unique())) == (columns, rows)
    assert len(places.unique(dim=0)) == copies
    for side, length in zip(places.T, (columns, rows), strict=True):
        assert side.min() == pytest.approx(-0.2)
        assert side.max() == pytest.approx(0.2 if length > 1 else -0.2)


def test_self_attention_is_the_softmax_of_all_products_forward_and_backward():
    layer, x = awake(SelfAttention(18)).double(), torch.randn(2, 11, 18, dtype=torch.float64, requires_grad=True)
    q, k, v = (F.relu(part(x)) for part in (layer.query, layer.key, layer.value))
    assert q.shape[-1] == k.shape[-1] == 4
    slow = x + layer.gamma * torch.softmax(q @ k.transpose(1, 2), dim=-1) @ v
    fast = layer(x)
    torch.testing.assert_close(fast, slow)
    towards, wanted = torch.randn_like(fast), (x, *layer.parameters())
    for a, b in zip(*(torch.autograd.grad(y, wanted, towards) for y in (fast, slow)), strict=True):
        torch.testing.assert_close(a, b)


def test_self_attention_starts_as_nothing():
    x = torch.randn(1, 9, 8)
    assert torch.equal(SelfAttention(8)(x), x)


def test_self_attention_never_holds_all_products():
    """The fused kernel takes it as it is, there and back; asked for alone, it is refused where it can't."""
    x = torch.randn(2, 40, 130, requires_grad=True)
    with sdpa_kernel(SDPBackend.FLASH_ATTENTION):
        awake(SelfAttention(130))(x).sum().backward()
    assert x.grad.abs().max() > 0


def literal(upsampler: UpDownUp, features: torch.Tensor) -> torch.Tensor:
    """One cloud (n c); all first copies, then all second ones, as the original has them in memory."""
    n, copies = len(features), len(upsampler.up.grid)

    def up(part, low):
        high = torch.cat([torch.cat([low, place.expand(n, 2)], dim=1) for place in part.grid])
        q, k, v = (F.relu(layer(high)) for layer in (part.attention.query, part.attention.key, part.attention.value))
        return part.mlp(high + part.attention.gamma * torch.softmax(q @ k.T, dim=-1) @ v)

    low = F.relu(upsampler.narrow(features))
    first = up(upsampler.up, low)
    back = upsampler.down.mlp(torch.stack([first[i::n].flatten() for i in range(n)]))
    second = first + up(upsampler.again, back - low)
    return upsampler.regressor(second).view(copies, n, 3).transpose(0, 1).flatten(0, 1)


@pytest.mark.parametrize("surplus", [0, 2])
def test_up_down_up_is_the_original_in_another_order(surplus):
    upsampler = awake(UpDownUp(Widths(refined=10, rate=3), channels=8, surplus=surplus)).double()
    points, features = torch.randn(2, 7, 3).double(), torch.randn(2, 7, 10).double()
    dense = upsampler(points, features, 3)
    assert dense.shape == (2, 7 * (3 + surplus), 3)
    torch.testing.assert_close(dense, torch.stack([literal(upsampler, cloud) for cloud in features]))


def test_the_farthest_of_six_copies_make_a_rate_of_four():
    net, points = network(channels=16), torch.randn(2, 20, 3)
    assert net.train()(points, 4).shape == (2, 80, 3)
    dense = net.eval()(points, 4)
    assert dense.shape == (2, 80, 3)
    made = net.upsampler(points, net.backbone(points, net.encoder(points)), 4)
    assert made.shape == (2, 120, 3)
    for row, kept in zip(made, dense, strict=True):
        assert torch.equal(row[torch.from_numpy(farthest_points(row.detach().numpy(), 80))], kept)


def test_the_order_of_the_points_changes_the_order_of_the_result_alone():
    net = awake(network(neighbours=5, channels=16)).double()
    points, shuffled = torch.randn(1, 12, 3).double(), torch.randperm(12)
    one, other = (net.upsampler(p, net.backbone(p, net.encoder(p)), 4) for p in (points, points[:, shuffled]))
    torch.testing.assert_close(other.view(12, 6, 3), one.view(12, 6, 3)[shuffled])


def test_another_rate_is_refused():
    with pytest.raises(UserError, match="built for rate 3, not 4"):
        UpDownUp(Widths(refined=10, rate=3))(torch.randn(1, 7, 3), torch.randn(1, 7, 10), 4)


# --- the discriminator


def test_the_discriminator_sees_a_set():
    judge, points = awake(Discriminator()), torch.randn(3, 15, 3)
    verdict = judge(points)
    assert verdict.shape == (3,)
    torch.testing.assert_close(judge(points[:, torch.randperm(15)]), verdict)
    single = judge.single(points[0])
    joint = judge.attention(torch.cat([single, single.amax(0).expand(15, -1)], dim=1)[None])[0]
    whole = torch.stack([judge.widen(judge.joint(point)) for point in joint]).amax(0)
    torch.testing.assert_close(verdict[0], judge.verdict(whole)[0])


# --- the objective


def slow_uniformity(cloud: torch.Tensor) -> float:
    """One cloud (n 3), one disc and one point at a time."""
    n, values = len(cloud), []
    for share in SHARES:
        gaps = []
        for seed in farthest_points(cloud.numpy(), max(1, int(0.05 * n))):
            away = (cloud - cloud[seed]).norm(dim=-1)
            order = away.argsort().tolist()[: max(2, int(share * n))]
            disc = [j if away[j] <= math.sqrt(share) else seed for j in order]
            for a, j in enumerate(disc):
                gap = min(float((cloud[j] - cloud[other]).norm()) for b, other in enumerate(disc) if b != a)
                even = math.sqrt(math.pi / n)
                gaps.append((math.sqrt(gap**2 + 1e-8) - even) ** 2 / even)
        values.append((100 * share) ** 2 * sum(gaps) / len(gaps))
    return sum(values) / len(values)


@pytest.mark.parametrize("n", [20, 300, 700])
def test_uniformity_is_that_of_each_disc_and_each_point(n):
    clouds = torch.stack([sphere(n, torch.float64), sphere(n, torch.float64) * torch.tensor([1, 1, 0.1])])
    expected = torch.tensor([slow_uniformity(cloud) for cloud in clouds], dtype=torch.float64)
    torch.testing.assert_close(uniformity(clouds), expected)


def test_uniformity_likes_an_even_disc_better():
    n = torch.arange(1, 801, dtype=torch.float64)
    angle = n * math.pi * (3 - math.sqrt(5))  # a sunflower: points that share the unit disc evenly
    even = torch.stack([torch.cos(angle), torch.sin(angle), 0 * n], dim=1) * (n / 800).sqrt()[:, None]
    random = torch.rand(800, 2, dtype=torch.float64)
    angle = 2 * math.pi * random[:, 1]
    uneven = torch.stack([torch.cos(angle), torch.sin(angle), 0 * angle], dim=1) * random[:, :1].sqrt()
    values = uniformity(torch.stack([even, uneven]))
    assert values[0] < 0.5 * values[1]


def test_uniformity_of_coinciding_points_has_a_gradient_without_a_hole():
    points = sphere(200).repeat(2, 1).unsqueeze(0).requires_grad_()
    uniformity(points).sum().backward()
    assert points.grad.isfinite().all()


def test_the_objective_is_its_weighted_terms():
    objective = PuGan()
    made, true = 0.1 * torch.stack([sphere(60), sphere(60)]), torch.stack([sphere(60), sphere(60)])
    losses = objective(made, true)
    assert list(losses) == ["emd", "uniform", "repulsion", "generator", "discriminator"]
    assert losses["repulsion"] > 0
    apart = matched_distance(made, true)
    d_made, d_true = objective.discriminator(made), objective.discriminator(true)
    expected = (
        100 * apart.mean(),
        10 * uniformity(made).mean(),
        hinge_repulsion(made).mean(),
        0.5 * ((d_made - 1) ** 2).mean(),
        ((d_true - 1) ** 2).mean() + (d_made**2).mean(),
    )
    for got, wanted in zip(losses.values(), expected, strict=True):
        torch.testing.assert_close(got, wanted)


def test_generator_and_discriminator_do_not_train_each_other():
    objective, true = awake(PuGan()), sphere(50).unsqueeze(0)
    made = (0.1 * sphere(50)).unsqueeze(0).requires_grad_()
    losses = objective(made, true)
    judge = list(objective.discriminator.parameters())
    for name in ("emd", "uniform", "repulsion", "generator"):
        grads = torch.autograd.grad(losses[name], [made, *judge], retain_graph=True, allow_unused=True)
        assert all(grad is None for grad in grads[1:]), name
        assert grads[0].abs().max() > 0, name
    grads = torch.autograd.grad(losses["discriminator"], [made, *judge], allow_unused=True)
    assert grads[0] is None
    assert all(grad.abs().max() > 0 for grad in grads[1:])


def test_gradient_reaches_every_weight():
    net, objective = awake(network(neighbours=8)), awake(PuGan())
    points, true = torch.stack([sphere(24), sphere(24)]), torch.stack([sphere(96), sphere(96)])
    sum(objective(net(points, 4), true).values()).backward()
    for name, weight in [*net.named_parameters(), *objective.named_parameters()]:
        assert weight.grad is not None, name
        assert weight.grad.abs().max() > 0, name


def test_a_few_steps_bring_the_clouds_nearer_and_teach_the_discriminator():
    net, objective = network(neighbours=8), PuGan()
    groups = [{"params": net.parameters()}, {"params": objective.parameters(), "lr": 1e-3 * objective.lr_multiplier}]
    adam = torch.optim.Adam(groups, lr=1e-3)
    points = torch.stack([sphere(32), 0.5 * sphere(32)])
    true = torch.stack([sphere(128), 0.5 * sphere(128)])
    history = []
    for _ in range(25):
        losses = objective(net(points, 4), true)
        adam.zero_grad()
        sum(losses.values()).backward()
        adam.step()
        history.append({name: float(loss.detach()) for name, loss in losses.items()})
    assert history[-1]["emd"] < 0.7 * history[0]["emd"]
    assert history[-1]["discriminator"] < history[0]["discriminator"]
