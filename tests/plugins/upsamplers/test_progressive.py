"""`progressive`: 3PU's levels, each against a slow and obvious form of itself."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from pcsr import UserError, Widths
from pcsr_plugins.upsamplers.progressive import Expansion, Progressive, nearby_mean, unit_sphere
from tests.plugins.compare import close
from tests.plugins.published import mpu


@torch.no_grad()
def test_an_expansion_moves_copies_by_features_and_code():
    expansion, points, features = Expansion(6), torch.randn(2, 5, 3), torch.randn(2, 5, 6)
    codes = [[-0.2], [0.2]]
    close(expansion.code, torch.tensor(codes), 1e-7)
    dense = expansion(points, features)
    for i in range(5):
        for j, code in enumerate(torch.tensor(codes)):
            inputs = torch.cat([features[:, i], code.expand(2, -1)], dim=1)
            close(dense[:, 2 * i + j], points[:, i] + expansion.mlp(expansion.enter(inputs)), 1e-6)


@given(seed=st.integers(0, 10_000), n=st.integers(1, 30))
def test_unit_sphere_leaves_the_centroid_at_zero_and_the_farthest_point_at_one(seed, n):
    cloud = torch.randn(2, n, 3, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    framed, centre, radius = unit_sphere(cloud)
    close(framed.mean(1), torch.zeros(2, 3).double(), 1e-9)
    if n > 1:
        close(framed.norm(dim=-1).amax(1), torch.ones(2).double(), 1e-9)
    close(centre + radius * framed, cloud, 1e-12)


@pytest.mark.parametrize("k", [1, 3, 5])
@torch.no_grad()
def test_nearby_mean_weighs_by_space_and_features(k):
    cloud, fresh = torch.rand(2, 9, 3).double(), torch.rand(2, 9, 4).double()
    before, known = torch.rand(2, 4, 3).double(), torch.rand(2, 4, 4).double()
    found = nearby_mean(cloud, fresh, before, known, k)
    for b in range(2):
        nearest = [(before[b] - point).norm(dim=-1).argsort()[:k] for point in cloud[b]]
        space = [[(cloud[b, i] - before[b, j]).square().sum() for j in near] for i, near in enumerate(nearest)]
        alike = [[(fresh[b, i] - known[b, j]).square().sum() for j in near] for i, near in enumerate(nearest)]
        h_space, h_alike = (sum(min(row) for row in rows) / 9 for rows in (space, alike))
        for i, near in enumerate(nearest):
            weights = torch.stack(
                [
                    torch.exp(-2 * s / h_space) * torch.exp(-2 * a / h_alike)
                    for s, a in zip(space[i], alike[i], strict=True)
                ]
            )
            weights = weights / (weights + 1e-5).sum()
            close(found[b, i], weights @ known[b, near], 1e-9)


def test_the_weights_of_nearby_features_take_no_part_in_the_gradient():
    cloud, fresh, before, known = (torch.rand(1, 6, c, requires_grad=True) for c in (3, 4, 3, 4))
    nearby_mean(cloud, fresh, before, known, 3).sum().backward()
    assert known.grad is not None
    assert cloud.grad is fresh.grad is before.grad is None


def test_nearby_features_of_a_cloud_that_stays_where_it_was_are_finite():
    cloud, known = torch.rand(1, 6, 3), torch.rand(1, 6, 4)
    assert nearby_mean(cloud, known, cloud, known, 3).isfinite().all()


@torch.no_grad()
def test_the_second_level_starts_from_the_first_ones_cloud():
    network, points = mpu(4, neighbours=6), torch.rand(2, 20, 3)
    up = network.upsampler
    features = network.backbone(points, network.encoder(points))
    first, second = up.stages(points, features, 4)
    close(first, up.expansions[0](points, features), 0)
    centre = first.mean(1, keepdim=True)
    radius = (first - centre).norm(dim=-1).amax(1)[:, None, None]
    framed = (first - centre) / radius
    fresh = up.extractors[0].backbone(framed, up.extractors[0].encoder(framed))
    known = fresh + 0.2 * nearby_mean(first, fresh, points, features, 5)
    close(second, up.expansions[1](framed, known) * radius + centre)
    close(up(points, features, 4), second, 0)


@pytest.mark.parametrize(("rate", "counts"), [(2, [40]), (4, [40, 80]), (16, [40, 80, 160, 320])])
@torch.no_grad()
def test_each_level_has_as_many_points_as_it_says(rate, counts):
    network, points = mpu(rate, neighbours=5), torch.rand(1, 20, 3)
    clouds = network.upsampler.stages(points, network.backbone(points, network.encoder(points)), rate)
    assert [cloud.shape[1] for cloud in clouds] == counts


@pytest.mark.parametrize("rate", [1, 6, 12])
def test_a_rate_that_no_number_of_levels_makes_is_refused(rate):
    with pytest.raises(UserError, match=f"in steps of 2 and never meets the rate {rate}: choose a power of 2"):
        Progressive(Widths(refined=8, rate=rate))


def test_another_rate_than_it_was_built_for_is_refused():
    with pytest.raises(UserError, match="built for rate 4, not 2"):
        Progressive(Widths(refined=8, rate=4))(torch.rand(1, 20, 3), torch.rand(1, 20, 8), 2)


@torch.no_grad()
def test_levels_go_on_from_any_backbone():
    up = Progressive(Widths(refined=10, rate=4), neighbours=5)
    assert up(torch.rand(1, 20, 3), torch.rand(1, 20, 10), 4).shape == (1, 80, 3)
