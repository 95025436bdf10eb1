"""The points around a point: the nearest at each angle, so that a way leads across each gap."""

from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch.nn import functional as F

from pcsr import Widths
from pcsr_plugins.layers.local_frames import LocalFrames
from pcsr_plugins.upsamplers.edge_offsets import EdgeOffsets
from tests.plugins.slow_frames import curved, grid, rotation, slow_around

SEEDS = st.integers(0, 1000)


@pytest.mark.parametrize(("n", "neighbours", "spokes"), [(40, 16, 8), (40, 16, 5), (40, 6, 8), (3, 16, 8), (2, 1, 1)])
@pytest.mark.parametrize("flat", [True, False])
def test_around_is_what_it_is_angle_by_angle(n, neighbours, spokes, flat):
    points = curved(2, n) * torch.tensor([1.0, 1.0, 0.0 if flat else 1.0])
    frames = LocalFrames.of(points, neighbours)
    around = frames.around(spokes)
    assert around.shape == (2, n, min(spokes, neighbours, n - 1))
    for columns, displacements, normal in zip(
        *(each.flatten(0, 1) for each in (around, frames.offsets, frames.normal)), strict=True
    ):
        assert columns.tolist() == slow_around(displacements, normal, spokes)


@given(seed=SEEDS, neighbours=st.integers(1, 30), spokes=st.integers(1, 12))
@settings(max_examples=30)
def test_each_way_is_the_nearest_within_its_angle_or_nobody_is(seed, neighbours, spokes):
    frames = LocalFrames.of(curved(seed, 40), neighbours)
    around = frames.around(spokes)
    spokes = around.shape[2]
    height = (frames.offsets * frames.normal.unsqueeze(2)).sum(-1)
    flat = frames.offsets - height.unsqueeze(-1) * frames.normal.unsqueeze(2)
    x = F.normalize(flat[:, :, 0], dim=-1)
    y = torch.linalg.cross(frames.normal, x)
    angle = torch.atan2((flat * y.unsqueeze(2)).sum(-1), (flat * x.unsqueeze(2)).sum(-1)).rad2deg()
    cost = frames.offsets.norm(dim=-1) + 2 * height.abs()
    empty = torch.zeros(frames.index.shape[:2], dtype=torch.int64)
    for spoke, columns in enumerate(around.unbind(-1)):
        off = ((angle - 360 * spoke / spokes + 180) % 360 - 180).abs()
        within = off <= 180 / spokes
        taken = within.gather(2, columns.unsqueeze(-1)).squeeze(-1)
        assert torch.equal(taken, within.any(-1))
        nobody = ~within.any(-1)
        assert torch.equal(columns[nobody], empty[nobody]), "the nearest of all in turn"
        empty = empty + nobody
        best = cost.where(within, torch.inf).amin(-1)
        chosen = cost.gather(2, columns.unsqueeze(-1)).squeeze(-1)
        torch.testing.assert_close(chosen[~nobody], best[~nobody], atol=1e-9, rtol=0)


@given(seed=SEEDS, scale=st.floats(0.1, 10))
@settings(max_examples=20)
def test_around_does_not_depend_on_turns_and_scale(seed, scale):
    points = curved(seed)
    turned = scale * points @ rotation(seed, torch.float64)
    assert torch.equal(LocalFrames.of(turned, 16).around(8), LocalFrames.of(points, 16).around(8))


@given(seed=SEEDS)
@settings(max_examples=20)
def test_on_a_plane_away_from_its_border_the_same_ones_lie_around_whichever_side_is_up(seed):
    points, step, inside = grid(), 1.2 / 11, slice(2, -2)
    shift = 0.08 * step * (2 * torch.rand(144, 2, generator=torch.Generator().manual_seed(seed)) - 1)
    frames = LocalFrames.of((points + F.pad(shift, (0, 1))) @ rotation(seed, torch.float64), 16)
    one, other = (f.around(8).sort(-1).values.view(12, 12, 8) for f in (frames, replace(frames, normal=-frames.normal)))
    assert torch.equal(one[inside, inside], other[inside, inside])
    assert (one.diff(dim=-1)[inside, inside] > 0).all(), "there is somebody at each angle"


@given(seed=SEEDS, dimensions=st.sampled_from([1, 2, 3]), spokes=st.integers(1, 16))
@settings(max_examples=20)
def test_at_least_half_of_the_ways_are_different_ones_even_on_a_line_or_at_a_border(seed, dimensions, spokes):
    points = curved(seed, 40)
    points[..., dimensions:] = 0
    for columns in LocalFrames.of(points, 16).around(spokes).flatten(0, 1).tolist():
        assert 2 * len(set(columns)) >= len(columns)


@given(seed=SEEDS)
@settings(max_examples=5)
@torch.no_grad()
def test_a_way_leads_across_a_gap_where_all_of_the_nearest_lie_on_this_side(seed):
    line = torch.arange(-5.0, 6, dtype=torch.float64)
    flat = F.pad(torch.cartesian_prod(line + 0.05 * line.sign(), line), (0, 1))  # the gap is wider than two steps
    hole = (flat[:, 0] == 0) & (flat[:, 1].abs() < 3)
    points = flat[~hole] @ rotation(seed, torch.float64)
    before = (flat[~hole] - torch.tensor([-1.05, 0, 0])).norm(dim=1).argmin()
    frames = LocalFrames.of(points[None], 16)
    side = flat[~hole][frames.index[0, before], 0]
    assert (side[:8] < 0).all(), "the eight nearest do not lead across"
    assert (side[frames.around(8)[0, before]] > 0).any()
    dense = EdgeOffsets(Widths(refined=5)).double()(
        points[None], torch.zeros(1, len(points), 5, dtype=torch.float64), 4
    )
    middle = torch.zeros(3, dtype=torch.float64)
    assert (dense[0] - middle).norm(dim=1).min() < 0.2 < 1 < (points - middle).norm(dim=1).min()


def test_what_is_high_above_the_plane_is_not_around_where_another_is_at_that_angle():
    sheet = grid(7)
    middle = sheet[0, 24]
    step = 0.2
    above = middle + torch.tensor([0.7 * step, 0, 0.5 * step])
    points = torch.cat([sheet, above[None, None]], 1)
    frames = LocalFrames.of(points, 24)
    assert frames.index[0, 24, 0] == 49, "it is the nearest of all"
    assert 49 not in frames.index[0, 24, frames.around(8)[0, 24]]
