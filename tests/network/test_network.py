"""The whole network: touches that are there, missing, or joined to the cloud."""

import pytest
import torch

from pcsr import TouchBatch
from pcsr.contracts import Trait, Upsampler
from pcsr.errors import UserError
from pcsr.metrics.chamfer import chamfer
from tests.small_network import NO_FUSION, RATE, N, network


@pytest.fixture
def clouds():
    random = torch.Generator().manual_seed(3)
    points = torch.randn(4, N, 3, generator=random)
    points = points / points.norm(dim=-1).amax(1)[:, None, None]
    return points, torch.randn(4, 3, 12, 3, generator=random) / 3


@pytest.mark.parametrize("fusion", [("model.fusion=iterative",), ("model.fusion=concat",), NO_FUSION])
@torch.no_grad()
def test_zero_touches_are_no_touches_bit_for_bit(clouds, fusion):
    points, touches = clouds
    net = network(*fusion)
    alone = net(points, RATE)
    assert alone.shape == (4, RATE * N, 3)
    assert torch.equal(net(points, RATE, TouchBatch.of(touches[:, :0])), alone)
    assert torch.equal(net(points, RATE, TouchBatch.of(touches, torch.zeros(4, 3, dtype=torch.bool))), alone)
    assert not torch.equal(net(points, RATE, TouchBatch.of(touches)), alone)


@pytest.mark.parametrize("fusion", ["iterative", "concat"])
@torch.no_grad()
def test_rows_of_a_mixed_batch_are_the_rows_alone(clouds, fusion):
    points, touches = clouds
    net = network(f"model.fusion={fusion}")
    counts = (2, 0, 3, 1)
    mask = torch.arange(3) < torch.tensor(counts)[:, None]
    mixed = net(points, RATE, TouchBatch.of(touches, mask))
    for row, count in enumerate(counts):
        touch = TouchBatch.of(touches[row : row + 1, :count]) if count else None
        torch.testing.assert_close(mixed[row : row + 1], net(points[row : row + 1], RATE, touch), atol=1e-5, rtol=0)


@torch.no_grad()
def test_what_stands_in_the_place_of_a_missing_touch_does_not_matter(clouds):
    points, touches = clouds
    net, mask = network(), torch.tensor([[True, False, True]] * 4)
    other = touches.clone()
    other[:, 1] = 0.5
    assert torch.equal(net(points, RATE, TouchBatch.of(touches, mask)), net(points, RATE, TouchBatch.of(other, mask)))
    close = net(points, RATE, TouchBatch.of(touches[:, [0, 2]]))
    torch.testing.assert_close(net(points, RATE, TouchBatch.of(touches, mask)), close, atol=1e-5, rtol=0)


@pytest.mark.parametrize("fusion", ["iterative", "concat"])
def test_gradients_reach_every_part_and_the_touch_encoder(clouds, fusion):
    points, touches = clouds
    net = network(f"model.fusion={fusion}")
    mask = torch.tensor([[True, True, True], [False, False, False], [True, False, False], [True, True, False]])
    (net(points, RATE, TouchBatch.of(touches, mask)) ** 2).sum().backward()
    for name, weight in net.named_parameters():
        assert weight.grad is not None, name
        assert weight.grad.isfinite().all(), name
    for part in (net.touch_encoder, net.encoder, net.fusion, net.backbone, net.upsampler):
        assert any(weight.grad.abs().max() > 0 for weight in part.parameters())


@pytest.mark.parametrize("fusion", [("model.fusion=iterative",), ("model.fusion=concat",), NO_FUSION])
@torch.no_grad()
def test_the_order_of_the_points_does_not_matter(clouds, fusion):
    points, touches = clouds
    net, shuffled = network(*fusion), torch.randperm(N, generator=torch.Generator().manual_seed(5))
    truth = torch.randn(4, 50, 3, generator=torch.Generator().manual_seed(6)) / 2
    before = chamfer(net(points, RATE, TouchBatch.of(touches)), truth)
    after = chamfer(net(points[:, shuffled], RATE, TouchBatch.of(touches)), truth)
    torch.testing.assert_close(after, before, rtol=1e-4, atol=0)


@torch.no_grad()
def test_points_in_file_order_do_matter(clouds):
    points, _ = clouds
    net = network("model.encoder.order=file")
    before, after = net(points, RATE), net(points.flip(1), RATE)
    assert chamfer(before, after).min() > 1e-10


@torch.no_grad()
def test_without_fusion_the_output_is_thinned_to_the_rate(clouds):
    points, touches = clouds
    net = network(*NO_FUSION)
    dense = net(points, RATE, TouchBatch.of(touches[:, :2]))
    assert dense.shape == (4, RATE * N, 3)
    joined = torch.cat([points, touches[:, :2].flatten(1, 2)], dim=1)
    full = net(joined, RATE)
    assert full.shape == (4, RATE * (N + 24), 3)
    for thin, all_points in zip(dense, full, strict=True):
        nearest, index = torch.cdist(thin, all_points, compute_mode="donot_use_mm_for_euclid_dist").min(1)
        assert nearest.max() < 1e-6
        assert len(index.unique()) == RATE * N
    judged = net.train()(points, RATE, TouchBatch.of(touches[:, :2]))
    assert judged.shape == full.shape, "in training all is judged that was made"


class Doubled(Upsampler):
    """Prepares the points and others beside them, and copies what it is given."""

    def prepare(self, points, rate):
        return points if rate == 1 else torch.cat([points, points + 0.1], 1)

    def forward(self, points, features, rate):
        assert features.shape[:2] == points.shape[:2]
        return points.repeat_interleave(rate, dim=1)


@torch.no_grad()
def test_the_network_sees_what_its_upsampler_prepares_and_makes_the_rest(clouds):
    points, touches = clouds
    net = network()
    net.upsampler = Doubled()
    expected = torch.cat([points, points + 0.1], 1).repeat_interleave(2, dim=1)
    assert torch.equal(net(points, 4, TouchBatch.of(touches)), expected)
    (stage,) = net.stages(points, 4, TouchBatch.of(touches))
    assert torch.equal(stage, expected)
    assert torch.equal(net(points, 1), points)


def test_a_seed_gives_its_weights_and_leaves_the_random_state_alone():
    state = torch.get_rng_state()
    first, again, other = network(), network(), network("seed=1")
    assert torch.equal(torch.get_rng_state(), state)
    pairs = list(zip(first.parameters(), again.parameters(), other.parameters(), strict=True))
    assert all(torch.equal(a, b) for a, b, _ in pairs)
    assert not any(torch.equal(a, c) for a, _, c in pairs if a.dim() > 1)  # norms start at ones and zeros
    assert first.parameter_count == sum(a.numel() for a, _, _ in pairs)


def test_a_touch_encoder_that_nobody_hears_is_refused():
    with pytest.raises(UserError, match=r"'none' uses no touch features.*remove it"):
        network("model.fusion=none")


@pytest.mark.parametrize(("rate", "first"), [(9, 3), (12, 3), (16, 4), (24, 4), (32, 4), (64, 8), (11, 1), (128, 8)])
@torch.no_grad()
def test_two_passes_share_a_rate_near_its_root(clouds, rate, first):
    net, rates = network(*NO_FUSION), []

    class Noting(Upsampler):
        traits = frozenset({Trait.ANY_RATE})
        max_rate_per_pass = 8

        def forward(self, points, features, rate):
            rates.append(rate)
            return points.repeat_interleave(rate, dim=1)

    net.upsampler = Noting()
    assert net(clouds[0][:1], rate).shape == (1, rate * N, 3)
    assert rates == ([rate] if first == 1 else [first, rate // first])


@torch.no_grad()
def test_a_great_rate_is_made_of_what_was_made_and_touches_are_in_it_at_the_end(clouds):
    points, touches = clouds
    net = network("model.fusion=joint-cloud", "model.touch_encoder=null", "model.upsampler=edge-offsets")
    assert net.upsampler.max_rate_per_pass == 8
    assert torch.equal(net(points, 16), net(net(points, 4), 4))
    assert torch.equal(net(points, 8), net.stages(points, 8)[-1])
    dense = net(points, 16, TouchBatch.of(touches))
    assert dense.shape == (4, 16 * N, 3)
    for made, touch in zip(dense, touches.flatten(1, 2), strict=True):
        assert (torch.cdist(made, touch).amin(1) == 0).sum() > len(touch) / 2
    alone = net.train()(points, 16)
    assert alone.shape[1] == 16 * N, "in training one pass makes all"
