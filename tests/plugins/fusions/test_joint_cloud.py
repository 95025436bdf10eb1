"""`joint-cloud`: a few points of each touch join the cloud, and all touched points are in the result."""

from pathlib import Path

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

import pcsr
from pcsr import TouchBatch, Trait, UserError, Widths
from pcsr.geometry.ordering import hilbert_order
from pcsr.network.build import build
from pcsr.plugins.loading import load_plugins
from pcsr.recipe import load
from pcsr_plugins.fusions.joint_cloud import JointCloud
from pcsr_plugins.fusions.none import NoFusion

WIDTHS = Widths(visual=6, touch=3)
N, RATE = 40, 4
ALL = torch.ones(2, 3, dtype=torch.bool)


def given_clouds(seed=0, touches=3, points=20):
    random = torch.Generator().manual_seed(seed)
    return torch.randn(2, N, 3, generator=random), torch.randn(2, touches, points, 3, generator=random)


def rows_of(cloud):
    return sorted(map(tuple, cloud.tolist()))


def test_it_claims_what_the_host_acts_on_and_has_no_weights():
    fusion = JointCloud(WIDTHS)
    assert JointCloud.traits == {Trait.PERMUTATION_EQUIVARIANT, Trait.TOUCH_PERMUTATION_INVARIANT}
    assert JointCloud.keeps_touched_points
    assert not NoFusion.keeps_touched_points
    assert not JointCloud.uses_touch_features
    assert not list(fusion.parameters())
    points, touches = given_clouds()
    features = torch.randn(2, N, 6)
    assert fusion(points, features, TouchBatch(touches, touches, ALL)) is features


@given(seed=st.integers(0, 1000), m=st.integers(1, 30), some=st.integers(0, 40))
def test_every_so_manieth_point_of_each_touch_joins_behind_the_cloud(seed, m, some):
    points, touches = given_clouds(seed, points=m)
    joined = JointCloud(WIDTHS, points=some).join(points, TouchBatch.of(touches, ALL))
    kept = min(some, m)
    assert joined.shape == (2, N + 3 * kept, 3)
    assert torch.equal(joined[:, :N], points)
    for row, touched_points in zip(joined[:, N:].reshape(2, 3, kept, 3), touches, strict=True):
        for few, touch in zip(row, touched_points, strict=True):
            along = touch[hilbert_order(touch)]
            for i in range(kept):
                assert torch.equal(few[i], along[i * m // kept])
            assert len({tuple(point) for point in few.tolist()}) == kept, "no point twice"


@given(seed=st.integers(0, 1000), some=st.integers(1, 20))
def test_neither_the_order_of_touches_nor_that_of_their_points_decides_who_joins(seed, some):
    points, touches = given_clouds(seed)
    random = torch.Generator().manual_seed(seed)
    a, m = torch.randperm(3, generator=random), torch.randperm(20, generator=random)
    fusion = JointCloud(WIDTHS, points=some)
    one, other = (
        fusion.join(points, TouchBatch.of(touches, ALL)),
        fusion.join(points, TouchBatch.of(touches[:, a][:, :, m], ALL)),
    )
    assert [rows_of(row) for row in one] == [rows_of(row) for row in other]


def test_of_a_dense_touch_points_spread_over_it_join():
    line = torch.zeros(1, 1, 800, 3)
    line[..., 0] = torch.linspace(0, 1, 800)
    joined = JointCloud(WIDTHS, points=8).join(torch.zeros(1, 1, 3), TouchBatch.of(line))[0, 1:]
    assert (line[0, 0, :, :1] - joined[:, 0]).abs().amin(1).max() < 0.15


def test_missing_touches_do_not_join_and_rows_may_miss_different_ones():
    points, touches = given_clouds()
    mask = torch.tensor([[True, False, True], [False, True, True]])
    joined = JointCloud(WIDTHS).join(points, TouchBatch.of(touches, mask))
    for row, touched_points, there in zip(joined[:, N:], touches, mask, strict=True):
        assert rows_of(row) == rows_of(touched_points[there].flatten(0, 1))


@pytest.mark.parametrize(("fusion", "name"), [(JointCloud(WIDTHS), "joint-cloud"), (NoFusion(WIDTHS), "none")])
def test_rows_of_different_numbers_of_touches_are_refused_by_name(fusion, name):
    points, touches = given_clouds()
    mask = torch.tensor([[True, False, True], [False, True, False]])
    with pytest.raises(UserError, match=rf"fusion '{name}' joins.*got \[2, 1\]: group the rows"):
        fusion.join(points, TouchBatch.of(touches, mask))


def test_without_touches_the_cloud_stays_as_it_is():
    points, touches = given_clouds()
    fusion = JointCloud(WIDTHS)
    assert torch.equal(fusion.join(points, TouchBatch.of(touches[:, :0], ALL[:, :0])), points)
    assert torch.equal(fusion.join(points, TouchBatch.of(touches, ~ALL)), points)


@pytest.mark.parametrize("count", [0, 3])
def test_touches_of_no_points_are_left_out(count):
    points, touches = given_clouds(touches=count, points=0)
    assert torch.equal(JointCloud(WIDTHS).join(points, TouchBatch.of(touches, ALL[:, :count])), points)


def test_in_use_nobody_joins():
    points, touches = given_clouds()
    assert JointCloud(WIDTHS).eval().join(points, TouchBatch.of(touches, ALL)) is points


# --- in a network


@pytest.fixture(scope="module")
def network():
    (recipe,) = load(Path(pcsr.__file__).parent / "recipes" / "frames.yaml", load_plugins())
    net = build(recipe, load_plugins()).eval()
    with torch.random.fork_rng():
        torch.manual_seed(0)
        torch.nn.init.normal_(net.upsampler.mlp[-1].weight, std=0.05)
    return net


@torch.no_grad()
def test_touched_points_are_in_the_result_more_of_them_than_had_joined(network):
    points, touches = given_clouds(points=400)
    touches = 0.05 * touches + points[:, :3, None]  # patches here and there, denser than the result
    dense = network(points, RATE, TouchBatch.of(touches, ALL))
    assert dense.shape == (2, RATE * N, 3)
    for row, touched_points, cloud in zip(
        dense, touches, network.fusion.join(points, TouchBatch.of(touches, ALL)), strict=True
    ):
        result, touched = set(rows_of(row)), set(rows_of(touched_points.flatten(0, 1)))
        assert result & touched
        assert (result & touched) - set(rows_of(cloud)), "points that did not join are candidates too"


@torch.no_grad()
def test_zero_touches_are_no_touches_bit_for_bit(network):
    points, touches = given_clouds()
    alone = network(points, RATE)
    assert alone.shape == (2, RATE * N, 3)
    assert torch.equal(network(points, RATE, TouchBatch.of(touches[:, :0])), alone)
    assert torch.equal(network(points, RATE, TouchBatch.of(touches, ~ALL)), alone)
    assert torch.equal(network(points, RATE, TouchBatch.of(touches[:, :, :0], ALL)), alone)
    assert not torch.equal(network(points, RATE, TouchBatch.of(touches)), alone)


@torch.no_grad()
def test_one_touched_point_is_heard(network):
    points, touches = given_clouds(touches=1, points=1)
    dense = network(points, RATE, TouchBatch.of(touches))
    assert dense.shape == (2, RATE * N, 3)
    assert all(
        touched_points in rows_of(row)
        for row, (touched_points,) in zip(dense, map(rows_of, touches.flatten(1, 2)), strict=True)
    )


def test_in_training_all_touched_points_are_there_and_those_that_joined_make_points_too(network):
    points, touches = given_clouds(points=100)
    network.train()
    try:
        dense = network(points, RATE, TouchBatch.of(touches, ALL))
    finally:
        network.eval()
    made = RATE * (N + 3 * network.fusion.points)
    assert dense.shape == (2, made + 300, 3)
    assert torch.equal(dense[:, made:], touches.flatten(1, 2))
